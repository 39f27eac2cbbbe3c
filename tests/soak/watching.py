"""`rulec watch` as a process that is started, killed, interrupted."""

from __future__ import annotations

import csv
import io
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.live.journal.store import open_journal
from rulec_runtime.recordings.recording_file import read_file

from rulec.simulation.predict import predict
from rulec.simulation.prediction import Injected, rewrite
from tests.conftest import SOURCES, compiled
from tests.figures.ledger import Share
from tests.live.journal.events import events_in
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
        self.written, self.over = 0, threading.Event()
        self._stop, self._enough = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

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


Identity = tuple[str, float]
"""A fault and since when."""


def events_of(journal: Path | str) -> list[Event]:
    """All events of plant abc in a journal, in order of their numbers."""
    with closing(open_journal(str(journal), make=False)) as opened:
        found = [entry.event for entry in opened.events("abc")]
    return sorted(found, key=lambda e: e.number)


def events_from(lines: Path) -> list[Event]:
    return events_in(lines)


def rows_of(journal: Path | str) -> tuple[int, list[float]]:
    """How many rows the state of a journal counts, and times of those that it still holds; none
    where no state is kept yet."""
    try:
        with closing(open_journal(str(journal), make=False)) as opened:
            saved = opened.state("abc")
    except JournalRefused:  # it is not made yet
        saved = None
    return (0, []) if saved is None else _rows(saved.state, str(journal))


def rows_in(state: Path) -> tuple[int, list[float]]:
    return _rows(state.read_bytes(), str(state)) if state.exists() else (0, [])


def _rows(state: bytes, name: str) -> tuple[int, list[float]]:
    from rulec_runtime.live.state import from_bytes

    memory, _ = from_bytes(compiled("abc"), state, name)
    return memory.count, [float(t) for t in memory.recent.time]


def outcome(
    events: Sequence[Event],
    planted: Sequence[Injected],
    end: float = float("inf"),
    said: str = "",
) -> dict[str, Any]:
    """What all parts say of their events, and of what the watch wrote on the terminal."""
    found = numbers(events) | against_plant(events, planted, end) | bad_output(said)
    return {"events": len(events), **found}


def numbers(events: Iterable[Event]) -> dict[str, int]:
    """Numbers of events that are missing, or there twice."""
    there = [event.number for event in events]
    return {
        "numbers_lost": max(there, default=0) - len(set(there)),
        "numbers_twice": len(there) - len(set(there)),
    }


def last_events(events: Sequence[Event]) -> list[Event]:
    """The last event of each episode of a fault, a sensor or something unknown, unless that was
    withdrawn."""
    last: dict[str, Event] = {}
    for event in events:
        if event.episode.kind in ("fault", "sensor", "unknown"):
            last[event.episode.id] = event
    return [event for event in last.values() if event.what != "withdrawn"]


def against_plant(
    events: Sequence[Event], planted: Sequence[Injected], end: float
) -> dict[str, Any]:
    """Faults over before `end` that were told once, never, more than once; what nobody planted."""
    episodes = [event.episode for event in last_events(events)]
    over = [f for f in planted if f.until < end]
    count = [sum(_is_of(e, f) for e in episodes) for f in over]
    strange = [
        f"{e.subject or e.text}@{e.since:.0f}"
        for e in episodes
        if not any(_is_of(e, f) for f in planted)
    ]
    return {
        "faults": len(over),
        "faults_lost": sum(n == 0 for n in count),
        "faults_twice": sum(n > 1 for n in count),
        "faults_strange": len(strange),
        "strange": strange,
    }


def _is_of(episode: Episode, fault: Injected) -> bool:
    at_one_time = episode.since <= fault.until and fault.since <= episode.until
    return episode.subject == fault.fault and at_one_time


def against_undisturbed(events: Sequence[Event], quiet: Sequence[Event]) -> dict[str, int]:
    """Episodes by name and beginning: those of the undisturbed watch that are missing, and those
    that are there beyond them."""
    mine, theirs = ([_identity(e) for e in last_events(part)] for part in (events, quiet))
    return {
        "episodes": len(theirs),
        "lost": sum(max(theirs.count(k) - mine.count(k), 0) for k in set(theirs)),
        "twice": sum(max(mine.count(k) - theirs.count(k), 0) for k in set(mine)),
    }


def _identity(event: Event) -> Identity:
    return event.episode.subject or event.episode.kind, event.episode.since


def bad_output(text: str) -> dict[str, int]:
    """Tracebacks, and characters that steer a terminal."""
    steering = sum(1 for c in text if (ord(c) < 32 and c not in "\n\t") or 127 <= ord(c) < 160)
    return {"tracebacks": text.count("Traceback"), "steering": steering}


LOST = ("numbers_lost", "rows_lost", "lost", "faults_lost", "episodes_without_end")
TWICE = ("numbers_twice", "rows_twice", "twice", "faults_twice", "episodes_ended_twice")
BAD = ("tracebacks", "steering")


def summed(form: Mapping[str, Any]) -> dict[str, Any]:
    """The form with these; as it is where the part was skipped."""
    if "skipped" in form:
        return dict(form)
    return {
        **form,
        "went_on": Share(form["survived"], form["tried"]).form(),
        "all_lost": sum(form.get(name, 0) for name in LOST),
        "all_twice": sum(form.get(name, 0) for name in TWICE),
        "all_bad": sum(form.get(name, 0) for name in BAD),
    }


def heed_interrupts() -> None:
    """Whoever runs us in the background has interrupts ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Watch:
    """Watches of plant abc one after the other, with the same options, in a folder of their own."""

    def __init__(
        self,
        folder: Path,
        *options: str,
        journal: str = "journal.db",
        shown: int | None = None,
    ) -> None:
        """`shown` is a terminal to speak to instead of a file."""
        rules = folder / "abc.ruleset.json"
        if not rules.exists():
            rules.write_text(compiled("abc").to_json(), encoding="utf-8")
        command = (sys.executable, "-m", "rulec_runtime", "watch", rules.name)
        self._command = [*command, *options, *(("--journal", journal) if journal else ())]
        self._folder, self._journal, self._shown = folder, folder / journal, shown
        self._said = folder / f"{Path(journal).name or 'watch'}.said"
        self._process: subprocess.Popen[bytes] | None = None
        self.lives = 0

    def start(self, *more: str) -> None:
        environment = {**os.environ, "PYTHONPATH": SOURCES, "OMP_NUM_THREADS": "1"}
        with self._said.open("ab") as said:
            self._process = subprocess.Popen(
                [*self._command, *more],
                cwd=self._folder,
                env={**environment, "TERM": "xterm", "COLUMNS": "80"},
                stdin=subprocess.DEVNULL,
                stdout=said if self._shown is None else self._shown,
                stderr=subprocess.STDOUT,
                preexec_fn=heed_interrupts,
                start_new_session=self._shown is not None,
            )
        self.lives += 1

    @property
    def runs(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """As when the power fails."""
        self._end(signal.SIGKILL, 10)

    def interrupt(self) -> int:
        """As by Ctrl-C; the exit code."""
        return self._end(signal.SIGINT, 60)

    def ended(self, seconds: float = 120.0) -> int:
        """The exit code, when it ends by itself."""
        assert self._process is not None
        return self._process.wait(seconds)

    def _end(self, how: signal.Signals, seconds: float) -> int:
        assert self._process is not None
        self._process.send_signal(how)
        return self._process.wait(seconds)

    @property
    def rows(self) -> int:
        return rows_of(self._journal)[0]

    @property
    def events(self) -> list[Event]:
        return events_of(self._journal)

    @property
    def said(self) -> str:
        """All that it wrote on the terminal."""
        return self._said.read_bytes().decode("utf-8", "replace")
