"""Rows that come at ten a second, on one core, and looks at everything beside them on another.

What either core does takes as long as the processor time it costs: other work on this machine
disturbs that less than a clock. Looks are done in a process of their own, as in the watch. Rows that
come while others are judged wait for the end of that, and are judged together.
"""

from __future__ import annotations

import time
from concurrent.futures import wait as wait_for
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.live.look_process import LookProcess
from rulec_runtime.live.looked import Asked, Looked
from rulec_runtime.live.memory import Memory
from rulec_runtime.recordings.recording import Recording

from tests.rig.follower.plants import part_of

INTERVAL = 0.1
"""Seconds from row to row."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """Per row, shape (n,): s from its coming to the end of its judgement, and whether events were
    told with it; the processor time of each look beside, s, and the share of its core that judging
    rows took."""

    late: Array
    told_of: np.ndarray
    looks: tuple[float, ...]
    busy: float


def followed(ruleset: Ruleset, recording: Recording) -> Run:
    """Judge a recording as if its rows came now."""
    memory, first = nothing_yet(ruleset, False), 0
    late, told_of = np.zeros(len(recording)), np.zeros(len(recording), dtype=bool)
    came = INTERVAL * np.arange(len(recording))
    clock = Clock()
    with closing(LookProcess(ruleset)) as process:
        looks = OtherCore(process, clock)
        while first < len(recording):
            clock.wait_until(float(came[first]))
            last = int(np.searchsorted(came, clock.now(), side="right"))
            for told in follow(ruleset, memory, part_of(recording, first, last), looks):
                memory = told.memory
                told_of[first:last] |= bool(told.events)
            late[first:last] = clock.now() - came[first:last]
            first = last
    spent = clock.spent / (len(recording) * INTERVAL)
    return Run(late=late, told_of=told_of, looks=tuple(looks.costs), busy=spent)


class Clock:
    """Time of the core that judges rows, s: its processor time, and what it waited."""

    def __init__(self) -> None:
        self._began, self._waited = time.process_time(), 0.0

    @property
    def spent(self) -> float:
        """Processor time so far, s."""
        return time.process_time() - self._began

    def now(self) -> float:
        """Time since the beginning, s."""
        return self.spent + self._waited

    def wait_until(self, moment: float) -> None:
        """Let time pass until then, if that is not yet over."""
        self._waited += max(moment - self.now(), 0.0)


@dataclass
class OtherCore:
    """Looks in another process, which takes its own processor time."""

    process: LookProcess
    clock: Clock
    costs: list[float] = field(default_factory=list)

    def begin(self, ruleset: Ruleset, memory: Memory) -> Asked:
        """Do it, and hand it out when it would be done."""
        before, pid = _spent(self.process.pid), self.process.pid
        asked, since = self.process.begin(ruleset, memory), self.clock.now()
        wait_for([asked.answer])
        # The first look waits for the start of its process.
        cost = _spent(self.process.pid) - (before if pid == self.process.pid else 0.0)
        self.costs.append(cost)
        return Later(asked, self.clock, since + cost)


@dataclass(frozen=True)
class Later:
    """A look that has ended from a moment on."""

    asked: Asked
    clock: Clock
    ready: float

    def found(self, wait: bool) -> Looked | None:
        """What it found, from that moment on."""
        if wait:
            self.clock.wait_until(self.ready)
        return self.asked.found(wait=True) if self.clock.now() >= self.ready else None

    def drop(self) -> None:
        """Nobody needs it any more."""
        self.asked.drop()


def _spent(pid: int | None) -> float:
    """Processor time of the only busy thread of a process, s; as Linux tells it."""
    if pid is None:
        return 0.0
    return 1e-9 * float(Path(f"/proc/{pid}/schedstat").read_text().split()[0])
