"""The source killed and started again, while the watch runs on."""

import random
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rulec_runtime.live.episode import Event

from tests.live.sources.plant_server import free_port
from tests.soak import score
from tests.soak.plant import Course, course
from tests.soak.served import maps, write_play
from tests.soak.watching import Watch

LEAD, STEP = 5.0, 0.2
"""Seconds before the first row, and from row to row."""
PATIENCE = 90.0
"""Seconds that the watch has to be connected again."""


class Served:
    """A process that serves the plant and can be killed."""

    def __init__(self, kind: str, folder: Path) -> None:
        self.kind, self.folder, self.port = kind, folder, free_port()

    def start(self) -> None:
        words = (self.kind, str(self.port), str(self.folder / "play.json"))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.soak.served", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == b"up\n"

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()


def watched(folder: Path, what: Course, served: Served) -> tuple[Watch, float]:
    """A watch of a served plant, with a journal, and when its first row is due, s since 1970."""
    text = maps(served.kind, what, served.port, STEP)
    (folder / "map.yaml").write_text(text)
    start = time.time() + LEAD
    write_play(folder / "play.json", what, start, STEP)
    served.start()
    watch = Watch(folder, "--source", served.kind, "--map", "map.yaml")
    watch.start()
    return watch, start


def killed(kind: str, folder: Path, times: int) -> dict[str, Any]:
    """An OPC UA server, or an MQTT broker with the client that publishes."""
    draw, what = random.Random(3), course(folder, 300 + 200 * times, 200, 100)
    served = Served(kind, folder)
    watch, start = watched(folder, what, served)

    def connections() -> int:
        """How often the journal says that the plant is read again."""
        return of_connection(watch.events)["read_again"]

    until = time.monotonic() + PATIENCE
    while not watch.rows and time.monotonic() < until:
        time.sleep(0.2)
    reconnected, longest = 0, 0.0
    for _ in range(times):
        time.sleep(draw.uniform(1.0, 5.0))
        served.kill()
        known = connections()
        time.sleep(draw.uniform(0.0, 3.0))
        served.start()
        began = time.monotonic()
        while connections() <= known and time.monotonic() - began < PATIENCE:
            time.sleep(0.1)
        reconnected += connections() > known
        longest = max(longest, time.monotonic() - began)
    time.sleep(5.0)
    end = time.time()
    code = watch.interrupt()
    served.kill()
    return {
        "tried": times,
        "survived": reconnected if code == 0 else 0,
        "longest_until_read_again": round(longest, 1),
        **of_connection(watch.events),
        **score.outcome(watch.events, what.at(start, STEP), end, watch.said),
    }


def of_connection(events: Sequence[Event]) -> dict[str, int]:
    """How often it was told that the plant is read no more, that it is again, and rows missing."""
    source = [e for e in events if e.episode.kind == "source"]
    count = Counter(e.what for e in source)
    gaps = sum(1 for e in source if e.episode.subject == "gap")
    return {"told_lost": count["began"], "read_again": count["ended"], "told_gaps": gaps}
