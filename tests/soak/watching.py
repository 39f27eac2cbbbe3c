"""`rulec watch` as a process that is started, killed, interrupted, and what it told in the end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.live.journal.store import open_journal
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.live.state import from_bytes

from rulec.commands.simulate import simulate
from rulec.simulation.prediction import Injected
from tests.conftest import ROOT, SOURCES, compiled
from tests.live.journal.events import events_in
from tests.runtime.sheets import example

FAULTS = (("A.leakage", 0.3), ("B.dp.high", 0.1), ("C.clogging", 0.2), ("B.leakage", 0.3))
LEAD, ON, OFF = 60, 60, 40
"""Rows before the first fault, with a fault, and between two."""


@dataclass(frozen=True)
class Course:
    """Rows a second apart, without their times, and the faults in them by the number of rows."""

    titles: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    planted: tuple[Injected, ...]


def course(rows: int, on: int = ON, off: int = OFF) -> Course:
    """A recording of plant abc with as many faults as fit in, the last one over."""
    starts = range(LEAD, rows - on - off, on + off)
    planted = tuple(
        Injected(*FAULTS[i % len(FAULTS)], since, since + on - 1) for i, since in enumerate(starts)
    )
    shipped, random = example(), np.random.default_rng(5)
    inputs = {
        title: np.resize(np.array(cells, dtype=float), rows)
        for title, *cells in zip(shipped.header, *shipped.rows, strict=True)
    }
    inputs["time [s]"] = np.arange(float(rows))
    for speed in ("A.n [rpm]", "B.n [rpm]"):
        inputs[speed] *= random.normal(1.0, 0.0005, rows)
    made = simulate(ROOT / "plants" / "abc", inputs, faults=planted, noise=1).columns()
    read = {t: v for t, v in made.items() if t.partition(" ")[0] in compiled("abc").read}
    return Course(
        tuple(read), tuple(zip(*(v.tolist() for v in read.values()), strict=True)), planted
    )


class Logger(threading.Thread):
    """Writes a growing CSV file, a row every `pause` s, in halves now and then; once it is
    `enough`, until no fault is there, up to where the next one would begin."""

    def __init__(self, path: Path, course: Course, pause: float) -> None:
        super().__init__(daemon=True)
        self._path, self._course, self._pause = path, course, pause
        self.written, self.enough = 0, threading.Event()
        self.start()

    def run(self) -> None:
        starts = {fault.since for fault in self._course.planted}
        with self._path.open("wb", buffering=0) as out:
            out.write(",".join(["time [s]", *self._course.titles]).encode() + b"\n")
            for k, row in enumerate(self._course.rows):
                if k in starts and self.enough.is_set():
                    return
                line = ",".join([str(k), *(f"{value:.6g}" for value in row)]).encode() + b"\n"
                half = len(line) // 2 if k % 7 == 0 else 0
                out.write(line[:half])
                time.sleep(self._pause)
                out.write(line[half:])
                self.written = k + 1


class Watch:
    """Watches of plant abc one after the other, with the same options, in a folder of their own.

    What they find is in a journal, or in a file of lines beside one with their state.
    """

    def __init__(self, folder: Path, *options: str, kept: str = "journal.db") -> None:
        (folder / "abc.json").write_text(compiled("abc").to_json(), encoding="utf-8")
        self._folder, self._kept, self._lines = folder, folder / kept, kept.endswith(".jsonl")
        keeps = ("--events", kept, "--state", "state") if self._lines else ("--journal", kept)
        self._command = [sys.executable, "-m", "rulec_runtime", "watch", "abc.json"]
        self._command += [*options, *keeps]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, *more: str) -> None:
        with (self._folder / "said").open("ab") as said:
            self._process = subprocess.Popen(
                [*self._command, *more],
                cwd=self._folder,
                env={**os.environ, "PYTHONPATH": SOURCES, "OMP_NUM_THREADS": "1", "COLUMNS": "80"},
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
                # Whoever runs us in the background has interrupts ignored.
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )

    @property
    def runs(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def end(self, how: signal.Signals | None = None) -> int:
        """Its exit code, by a signal or when it ends by itself."""
        assert self._process is not None
        if how is not None:
            self._process.send_signal(how)
        return self._process.wait(120.0)

    @property
    def events(self) -> list[Event]:
        """All events, in order of their numbers."""
        if self._lines:
            return events_in(self._kept)
        with closing(open_journal(str(self._kept), make=False)) as opened:
            return sorted((e.event for e in opened.events("abc")), key=lambda e: e.number)

    def memory(self) -> Memory:
        """What it keeps of the rows that it has judged; nothing before there are any."""
        state: bytes | None = None
        with suppress(JournalRefused, FileNotFoundError):  # it is not made yet
            if self._lines:
                state = (self._folder / "state").read_bytes()
            else:
                with closing(open_journal(str(self._kept), make=False)) as opened:
                    saved = opened.state("abc")
                state = saved and saved.state
        return from_bytes(compiled("abc"), state, "state")[0] if state else nothing_yet(False)

    @property
    def rows(self) -> int:
        return self.memory().count

    def outcome(self, planted: Sequence[Injected], end: float = float("inf")) -> dict[str, Any]:
        """Events by their numbers, faults that were over before `end`, and mistakes on the
        terminal: what is lost, there twice or bad."""
        events, said = self.events, (self._folder / "said").read_bytes().decode("utf-8", "replace")
        numbers = [event.number for event in events]
        kinds = ("fault", "sensor", "unknown")
        last = {e.episode.id: e for e in events if e.episode.kind in kinds}
        episodes = [e.episode for e in last.values() if e.what != "withdrawn"]
        over = [fault for fault in planted if fault.until < end]
        of = {
            fault: [
                e
                for e in episodes
                if e.subject == fault.fault and e.since <= fault.until and fault.since <= e.until
            ]
            for fault in planted
        }
        known = {episode.id for found in of.values() for episode in found}
        return {
            "events": len(events),
            "numbers_lost": max(numbers, default=0) - len(set(numbers)),
            "numbers_twice": len(numbers) - len(set(numbers)),
            "faults": len(over),
            "faults_lost": sum(not of[fault] for fault in over),
            "faults_twice": sum(len(of[fault]) > 1 for fault in over),
            "strange": [
                f"{e.subject or e.text}@{e.since:.0f}" for e in episodes if e.id not in known
            ],
            "tracebacks_bad": said.count("Traceback"),
            "steering_bad": sum(
                (ord(c) < 32 and c not in "\n\t") or 127 <= ord(c) < 160 for c in said
            ),
        }
