"""Mutated rows through the whole watch: it goes on, and nothing steers a terminal."""

import os
import pty
import random
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

from tests.live.sources.taking import mutated
from tests.soak import score
from tests.soak.plant import LEAD, OFF, ON, Course, course
from tests.soak.watching import Watch

STEERING = (b"\x1b]", b"\x07", b"\xe2\x80\xae", b"\x1b[2J", b"\x9b")
"""What the pieces put in hold, and no picture of ours."""
ROWS = LEAD + ON + OFF + 1


def growing_file(folder: Path, times: int) -> dict[str, Any]:
    """Mutated rows in a file; sound ones follow. The watch speaks to a terminal of its own."""
    what, shown = course(folder, ROWS), list[bytes]()
    (folder / "log.csv").write_bytes(b"".join(_rows(what, times)))
    ours, theirs = pty.openpty()
    watch = Watch(folder, "--source", "log.csv", shown=theirs)
    watch.start("--until-end")
    os.close(theirs)

    def read() -> None:
        with suppress(OSError):  # the other end is closed
            while data := os.read(ours, 65536):
                shown.append(data)

    reader = Thread(target=read, daemon=True)
    reader.start()
    code = watch.ended(300)
    reader.join(5)
    os.close(ours)
    text, events = b"".join(shown), watch.events
    found = {e.episode.subject for e in events if e.what == "began"}
    return {
        "tried": times,
        "survived": times if code == 0 else 0,
        "tracebacks": text.count(b"Traceback"),
        "steering": sum(text.count(piece) for piece in STEERING),
        "shown_bytes": len(text),
        "faults": len(what.planted),
        "faults_lost": sum(f.fault not in found for f in what.planted),
        **score.numbers(events),
    }


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
