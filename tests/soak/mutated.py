"""Mutated rows and messages through the whole watch: it goes on, and nothing steers a terminal."""

from __future__ import annotations

import json
import os
import pty
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from tests.conftest import SOURCES, compiled
from tests.live.sources.test_hostile import mutated
from tests.soak import score
from tests.soak.plant import LEAD, OFF, ON, Course, course, texts
from tests.soak.served import maps, write_play
from tests.soak.sources import STEP, Served
from tests.soak.watching import heed_interrupts

STEERING = (b"\x1b]", b"\x07", b"\xe2\x80\xae", b"\x1b[2J", b"\x9b")
"""What the pieces put in hold, and no picture of ours."""
ROWS = LEAD + ON + OFF + 1


def standard_input(folder: Path, times: int) -> dict[str, Any]:
    """Rows of a pipe; sound ones follow."""
    what = course(folder, ROWS)
    return _result(times, *_watched(folder, "-", list(_rows(what, times))), what)


def growing_file(folder: Path, times: int) -> dict[str, Any]:
    """The same in a file."""
    what = course(folder, ROWS)
    (folder / "log.csv").write_bytes(b"".join(_rows(what, times)))
    return _result(times, *_watched(folder, "log.csv", [], "--until-end"), what)


def _rows(what: Course, times: int) -> Iterator[bytes]:
    """A header, mutated rows, sound ones whose times begin anew."""
    draw = random.Random(9)
    yield (",".join(["time [s]", *what.titles]) + "\n").encode()
    for k in range(times):
        sound = ",".join([str(k), *what.rows[k % LEAD]]) + "\n"
        yield mutated(sound.encode(), draw)
    yield b"\n"
    for k, row in enumerate(what.rows):
        yield (",".join([str(2_000_000 + k), *row]) + "\n").encode()


class _Shown:
    """A watch in a terminal of its own, and all that it shows there."""

    def __init__(self, folder: Path, source: str, *more: str) -> None:
        rules = folder / "abc.ruleset.json"
        rules.write_text(compiled("abc").to_json(), encoding="utf-8")
        self._folder, self._shown = folder, list[bytes]()
        self._ours, theirs = pty.openpty()
        words = ["--source", source, "--journal", "journal.db", *more]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rulec_runtime", "watch", rules.name, *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": SOURCES, "TERM": "xterm", "COLUMNS": "80"},
            stdin=subprocess.PIPE,
            stdout=theirs,
            stderr=theirs,
            preexec_fn=heed_interrupts,
        )
        os.close(theirs)
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def ended(self, seconds: float) -> tuple[int, bytes, list[Any]]:
        """Exit code, all that the terminal got, events."""
        code = self.process.wait(seconds)
        self._reader.join(5)
        os.close(self._ours)
        return code, b"".join(self._shown), score.events_of(self._folder / "journal.db")

    def _read(self) -> None:
        try:
            while data := os.read(self._ours, 65536):
                self._shown.append(data)
        except OSError:  # the other end is closed
            return


def _watched(
    folder: Path, source: str, rows: list[bytes], *more: str
) -> tuple[int, bytes, list[Any]]:
    """What came of it; rows go in by a pipe, not faster than read."""
    watch = _Shown(folder, source, *more)
    pipe = watch.process.stdin
    assert pipe is not None
    for k in range(0, len(rows), 50):
        pipe.write(b"".join(rows[k : k + 50]))
        pipe.flush()
        time.sleep(0.02)
    pipe.close()
    return watch.ended(300)


def messages(folder: Path, times: int) -> dict[str, Any]:
    """MQTT messages of a real broker; sound ones follow."""
    what, served = course(folder, ROWS), Served("mqtt", folder)
    (folder / "map.yaml").write_text(maps("mqtt", what, served.host, served.port, STEP))
    write_play(folder / "play.json", what, time.time() + 86_400.0, STEP)
    served.start()
    watch = _Shown(folder, "mqtt", "--map", "map.yaml")
    time.sleep(5.0)
    _publish(served, what, times)
    lives = watch.process.poll() is None
    watch.process.send_signal(signal.SIGINT)
    result = _result(times, *watch.ended(60), what)
    served.kill()
    return {**result, "lives": lives}


def _publish(served: Served, what: Course, times: int) -> None:
    """Mutated messages, then sound ones in time with the clock."""
    draw, names = random.Random(10), texts(what.titles)
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.connect(served.host, served.port)
    client.loop_start()
    for k in range(times):
        values = dict(zip(names, map(float, what.rows[k % LEAD]), strict=True))
        sound = json.dumps({"time": time.time() - 1e5, **values}).encode()
        client.publish("plant", mutated(sound, draw), qos=1).wait_for_publish(5)
    for row in what.rows:
        values = dict(zip(names, map(float, row), strict=True))
        sound = json.dumps({"time": time.time(), **values}).encode()
        client.publish("plant", sound, qos=1).wait_for_publish(5)
        time.sleep(STEP)
    time.sleep(3.0)
    client.disconnect()
    client.loop_stop()


def _result(times: int, code: int, shown: bytes, events: list[Any], what: Course) -> dict[str, Any]:
    found = {e.episode.subject for e in events if e.what == "began"}
    return {
        "tried": times,
        "survived": times if code == 0 else 0,
        "tracebacks": shown.count(b"Traceback"),
        "steering": sum(shown.count(piece) for piece in STEERING),
        "shown_bytes": len(shown),
        "faults": len(what.planted),
        "faults_lost": sum(f.fault not in found for f in what.planted),
        **score.numbers(e.number for e in events),
    }
