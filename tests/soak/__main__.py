"""Faults that `rulec watch` survives: `python -m tests.soak [PART...] [--times N] --json -`.

Each part says how often something was done to the watch or to its source, how often it went on
(`went_on`), and how much was lost (`all_lost`) or told twice (`all_twice`) in the end: events by
their numbers, rows of a file, faults that were planted. `all_bad` counts tracebacks, and what would
steer a terminal. The disk needs root.
"""

import argparse
import json
import pickle
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from signal import SIGINT, SIGKILL
from typing import Any

from tests.figures.ledger import Share
from tests.live.conftest import filled, mounted
from tests.live.sources.plant_server import free_port
from tests.soak.served import Play
from tests.soak.watching import LEAD, OFF, ON, Logger, Watch, course

PAUSE = 0.05  # s from row to row
LONGEST = 4.0  # s that it is left alone at most after it went on
STARTING = 1.5  # s within which every second restart is killed as well
ROUND = 30.0  # s that a kill and what follows take at most, as an average
PATIENCE = 120.0  # s that a restart has to read on, also on a busy machine


def watch_killed(kept: str, folder: Path, times: int) -> dict[str, Any]:
    """Kill a watch and start it again; each restart counts alone: has it read rows beyond those
    before the kill? None has survived if the last one does not end well."""
    what = course(int(times * ROUND / PAUSE) + 300)  # the logger ends behind the last kill
    watch, draw, survived = Watch(folder, "--source", "log.csv", kept=kept), random.Random(1), 0
    logger = Logger(folder / "log.csv", what, PAUSE)
    time.sleep(1.0)
    watch.start()
    for _ in range(times):
        time.sleep(draw.uniform(0.0, LONGEST))
        watch.end(SIGKILL)
        if draw.random() < 0.5:
            watch.start()
            time.sleep(draw.uniform(0.0, STARTING))
            watch.end(SIGKILL)
        before = watch.rows
        watch.start()
        survived += _met(lambda before=before: watch.rows > before, PATIENCE, watch)  # type: ignore[misc]
    logger.enough.set()
    logger.join()
    watch.end(SIGKILL)
    watch.start("--until-end")
    code, memory, balance = watch.end(), watch.memory(), Counter[str]()
    for event in watch.events:
        if event.episode.kind != "source":
            over = event.what in ("ended", "withdrawn")
            balance[event.episode.id] += (event.what == "began") - over
    return {
        "tried": times,
        "survived": survived if code == 0 else 0,
        "rows": logger.written,
        "rows_lost": logger.written - memory.count,
        "rows_twice": len(memory.recent) - len({*memory.recent.time.tolist()}),
        "ends_lost": sum(b > 0 for b in balance.values()),
        "ends_twice": sum(b < 0 for b in balance.values()),
        **watch.outcome(what.planted, logger.written),
    }


def _met(what: Callable[[], bool], seconds: float, watch: Watch) -> bool:
    """Does it become true within these seconds, while the watch runs?"""
    until = time.monotonic() + seconds
    while watch.runs and time.monotonic() < until:
        if what():
            return True
        time.sleep(0.2)
    return False


FULL = 4.0  # s that the disk is full: longer than a fault or the time between two
FREE = 4.0


def full(folder: Path, times: int) -> dict[str, Any]:
    """The journal is on the disk: the watch runs on."""
    rows = int((times + 1) * (FULL + FREE) / PAUSE) + LEAD + ON + OFF
    what, small, ran = course(rows), folder / "small", 0
    with mounted(small, "6m") as there:
        if not there:
            return {"skipped": "mounting a small file system needs root"}
        watch = Watch(folder, "--source", "log.csv", kept="small/journal.db")
        logger = Logger(folder / "log.csv", what, PAUSE)
        time.sleep(1.0)
        watch.start()
        for _ in range(times):
            _alive(watch, FREE)
            ballast = filled(small)
            time.sleep(FULL)
            ran += watch.runs
            ballast.unlink()
        while logger.is_alive():
            _alive(watch, 0.5)
        if watch.runs:
            time.sleep(12.0)  # the journal is tried again within ten seconds
            watch.end(SIGINT)
        watch.start("--until-end")
        survived = ran if watch.end() == 0 else 0
        lost = {"rows": rows, "rows_lost": rows - watch.rows}
        return {"tried": times, "survived": survived, **lost, **watch.outcome(what.planted)}


def _alive(watch: Watch, seconds: float) -> None:
    """Start it again where it ended, as systemd does."""
    until = time.monotonic() + seconds
    while True:
        if not watch.runs:
            watch.start()
        if time.monotonic() >= until:
            return
        time.sleep(0.5)


AHEAD, STEP = 5.0, 0.2
"""Seconds before the first row, and from row to row."""
RECONNECTED = 90.0
"""Seconds that the watch has to be connected again."""


def source_killed(kind: str, folder: Path, times: int) -> dict[str, Any]:
    """An OPC UA server, or an MQTT broker with the client that publishes."""
    draw, port = random.Random(3), free_port()
    play = Play(course(300 + 200 * times, 200, 100), time.time() + AHEAD, STEP)
    (folder / "play").write_bytes(pickle.dumps(play))
    (folder / "map.yaml").write_text(play.map_for(kind, port))
    words = (sys.executable, "-m", "tests.soak.served", kind, str(port), str(folder / "play"))

    def served() -> subprocess.Popen[bytes]:
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        return process

    def told() -> Counter[str]:
        """How often the plant was read no more, and again."""
        return Counter(e.what for e in watch.events if e.episode.kind == "source")

    server, watch = served(), Watch(folder, "--source", kind, "--map", "map.yaml")
    watch.start()
    _met(lambda: watch.rows > 0, RECONNECTED, watch)
    again, longest = 0, 0.0
    for _ in range(times):
        time.sleep(draw.uniform(1.0, 5.0))
        server.kill()
        server.communicate()
        known = told()["ended"]
        time.sleep(draw.uniform(0.0, 3.0))
        server = served()
        began = time.monotonic()
        again += _met(lambda known=known: told()["ended"] > known, RECONNECTED, watch)  # type: ignore[misc]
        longest = max(longest, time.monotonic() - began)
    time.sleep(5.0)
    end = time.time()
    code = watch.end(SIGINT)
    server.kill()
    server.communicate()
    planted = [
        replace(f, since=play.start + f.since * STEP, until=play.start + f.until * STEP)
        for f in play.course.planted
    ]
    return {
        "tried": times,
        "survived": again if code == 0 else 0,
        "longest_until_read_again": round(longest, 1),
        "told": told(),
        **watch.outcome(planted, end),
    }


PARTS: dict[str, tuple[Callable[[Path, int], dict[str, Any]], int]] = {
    "kill-journal": (partial(watch_killed, "journal.db"), 20),
    "kill-lines": (partial(watch_killed, "events.jsonl"), 20),
    "opcua": (partial(source_killed, "opcua"), 20),
    "mqtt": (partial(source_killed, "mqtt"), 20),
    "disk-journal": (full, 5),
}
"""Each with what it does, and how often."""


def summed(form: dict[str, Any]) -> dict[str, Any]:
    """The form with how often it went on, and all that is lost, twice or bad; as it is where the
    part was skipped."""
    if "skipped" in form:
        return form
    sums = {
        f"all_{what}": sum(form[name] for name in form if name.endswith(f"_{what}"))
        for what in ("lost", "twice", "bad")
    }
    return {**form, "went_on": Share(form["survived"], form["tried"]).form(), **sums}


def main() -> int:
    """Run the parts one after the other; the machine form on standard output."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--times", type=int, metavar="N", help="default 20 of most parts")
    parser.add_argument("--keep", metavar="DIR", help="leave all files there")
    parser.add_argument("--json", metavar="FILE", help="machine form; - for standard output")
    options = parser.parse_args()
    if strangers := set(options.parts) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(strangers))}")
    form: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="rulec-soak-") as folder:
        for name in options.parts or PARTS:
            part, usual = PARTS[name]
            work = Path(options.keep or folder) / name
            work.mkdir(parents=True, exist_ok=True)
            begin = time.perf_counter()
            form[name] = summed(part(work, options.times or usual))
            seconds = time.perf_counter() - begin
            print(f"{name}: {json.dumps(form[name])} ({seconds:.0f} s)", file=sys.stderr)
    text = json.dumps(form, indent=1)
    if options.json == "-":
        print(text)
    elif options.json:
        Path(options.json).write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
