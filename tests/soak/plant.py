"""A simulated plant with one fault after the other, as rows that somebody writes or serves."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Thread

import numpy as np
from rulec_runtime.recordings.recording_file import read_file

from rulec.simulation.predict import predict
from rulec.simulation.prediction import Injected, rewrite
from tests.conftest import compiled
from tests.runtime.sheets import example, write

FAULTS = (("A.leakage", 0.3), ("B.dp.high", 0.1), ("C.clogging", 0.2), ("B.leakage", 0.3))
LEAD, ON, OFF = 60, 60, 40
"""Rows before the first fault, with a fault, and between two."""


@dataclass(frozen=True)
class Course:
    """Rows a second apart, without their times, and the faults in them by the number of rows."""

    titles: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    planted: tuple[Injected, ...]

    def at(self, first: float, step: float) -> tuple[Injected, ...]:
        """What is planted, by times of a play whose first row is at `first`, s."""
        return tuple(
            replace(f, since=first + f.since * step, until=first + f.until * step)
            for f in self.planted
        )


def course(folder: Path, rows: int, on: int = ON, off: int = OFF) -> Course:
    """A recording of plant abc with as many faults as fit in, the last one over."""
    starts = range(LEAD, rows - on - off, on + off)
    planted = tuple(
        Injected(*FAULTS[i % len(FAULTS)], since, since + on - 1) for i, since in enumerate(starts)
    )
    played, random = io.StringIO(), np.random.default_rng(5)
    shipped = example()
    lasting = [(str(k), *shipped.rows[k % len(shipped.rows)][1:]) for k in range(rows)]
    sheet = replace(shipped, rows=tuple(lasting))
    for speed in ("A.n", "B.n"):
        sheet = sheet.mapped(speed, lambda _, c: f"{float(c) * random.normal(1.0, 0.0005):.6g}")
    inputs = write(folder, sheet.text(), "inputs.csv")
    ruleset = compiled("abc")
    source = read_file(inputs, ruleset, [])
    rewrite(source, ruleset, predict(ruleset, [source], planted, 1).values, played)
    head, *body = csv.reader(io.StringIO(played.getvalue()))
    read = [i for i, title in enumerate(head) if title.partition(" ")[0] in ruleset.read]
    return Course(
        tuple(head[i] for i in read), tuple(tuple(r[i] for i in read) for r in body), planted
    )


class Logger:
    """A thread that writes a growing CSV file, a row every `pause` s, in halves now and then."""

    def __init__(self, path: Path, course: Course, pause: float) -> None:
        self._course, self._pause = course, pause
        self._out = path.open("w", encoding="utf-8", buffering=1)
        self._out.write(",".join(["time [s]", *course.titles]) + "\n")
        self.written, self.over = 0, Event()
        self._stop, self._enough = Event(), Event()
        self._thread = Thread(target=self._run, daemon=True)

    def __enter__(self) -> Logger:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._thread.join()
        self._out.close()

    def finish(self) -> None:
        """Write on until no fault is there, up to where the next one would begin."""
        self._enough.set()
        self.over.wait()

    def _run(self) -> None:
        starts = {fault.since for fault in self._course.planted}
        for k, row in enumerate(self._course.rows):
            if k in starts and self._enough.is_set():
                break
            line = ",".join([str(k), *row]) + "\n"
            half = len(line) // 2 if k % 7 == 0 else 0
            self._out.write(line[:half])
            self._out.flush()
            if self._stop.wait(self._pause):
                break
            self._out.write(line[half:])
            self._out.flush()
            self.written = k + 1
        self.over.set()
