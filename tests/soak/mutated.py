"""Mutated rows through the whole watch: it goes on, and nothing steers a terminal."""

from __future__ import annotations

import os
import pty
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

from tests.conftest import SOURCES, compiled
from tests.live.sources.test_hostile import mutated
from tests.soak import score
from tests.soak.plant import LEAD, OFF, ON, Course, course
from tests.soak.watching import heed_interrupts

STEERING = (b"\x1b]", b"\x07", b"\xe2\x80\xae", b"\x1b[2J", b"\x9b")
"""What the pieces put in hold, and no picture of ours."""
ROWS = LEAD + ON + OFF + 1


def growing_file(folder: Path, times: int) -> dict[str, Any]:
    """Mutated rows in a file; sound ones follow."""
    what = course(folder, ROWS)
    (folder / "log.csv").write_bytes(b"".join(_rows(what, times)))
    return _result(times, *_Shown(folder).ended(300), what)


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

    def __init__(self, folder: Path) -> None:
        rules = folder / "abc.ruleset.json"
        rules.write_text(compiled("abc").to_json(), encoding="utf-8")
        self._folder, self._shown = folder, list[bytes]()
        self._ours, theirs = pty.openpty()
        words = ["--source", "log.csv", "--journal", "journal.db", "--until-end"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rulec_runtime", "watch", rules.name, *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": SOURCES, "TERM": "xterm", "COLUMNS": "80"},
            stdin=subprocess.DEVNULL,
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
