"""Rows that come at ten a second, on one core, and looks at everything beside them on another.

What either core does takes as long as the processor time it costs: other work on this machine
disturbs that less than a clock. Looks are done in a process of their own, as in the watch.
Rows that come while others are judged wait for the end of that, and are judged together. A row that
says something for which a look is due is judged when a look has seen it.
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
from rulec_runtime.live.follower import follow, nothing_yet, warm_up
from rulec_runtime.live.last_evaluation import Asked, Known, Looked
from rulec_runtime.live.levels import far_after
from rulec_runtime.live.look_process import LookProcess
from rulec_runtime.live.memory import Memory
from rulec_runtime.recordings.recording import Recording

from tests.rig.follower.plants import part_of

INTERVAL = 0.1
"""Seconds from row to row."""

POLL = 0.5
"""Seconds after which to look again how long a look has taken."""


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
    waiting: list[tuple[int, int, bool]] = []
    warm_up(ruleset)
    clock = Clock()
    with closing(LookProcess(ruleset)) as process:
        looks = OtherCore(process, clock, INTERVAL * len(recording))
        while first < len(recording):
            clock.wait_until(float(came[first]))
            last = int(np.searchsorted(came, clock.now(), side="right"))
            known, events = memory.known, False
            for told in follow(ruleset, memory, part_of(recording, first, last), looks):
                memory, events = told.memory, events or bool(told.events)
            waiting.append((first, last, _says_news(known, memory, last - first)))
            done, waiting = _done(waiting, memory)
            for begin, end in done:
                late[begin:end] = clock.now() - came[begin:end]
                told_of[begin:end] |= events
            first = last
        for begin, end, _ in waiting:
            late[begin:end] = clock.now() - came[begin:end]
    spent = clock.spent / (len(recording) * INTERVAL)
    return Run(late=late, told_of=told_of, looks=tuple(looks.costs), busy=spent)


def _says_news(known: Known | None, memory: Memory, new: int) -> bool:
    """Do the last rows say anything for which a look at everything is due?"""
    if known is None or memory.under_way is None:
        return False
    _, flags, odd = known.levels.after_rows(memory.recent, new, far_after(known.count))
    return odd or bool(known.moved(flags) & known.large - memory.under_way.seen)


def _done(
    waiting: list[tuple[int, int, bool]], memory: Memory
) -> tuple[list[tuple[int, int]], list[tuple[int, int, bool]]]:
    """Rows that are judged by now, and those that still wait for a look that has seen them."""
    seen = np.inf if memory.under_way is None or memory.known is None else memory.known.count
    done = [(first, last) for first, last, news in waiting if not news or last <= seen]
    return done, [one for one in waiting if one[2] and one[1] > seen]


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
    """Looks in another process, which takes its own processor time; rows come until `end`, s."""

    process: LookProcess
    clock: Clock
    end: float
    costs: list[float] = field(default_factory=list)

    def begin(self, ruleset: Ruleset, memory: Memory, headers: bool) -> Asked:
        """Do it, and hand it out when it would be done."""
        before, pid = _spent(self.process.pid), self.process.pid
        asked, since = self.process.begin(ruleset, memory, headers), self.clock.now()
        # The first look waits for the start of its process; one beyond the end is not waited for.
        before = before if pid == self.process.pid else 0.0
        cost, left = 0.0, self.end - since
        while cost < left and not wait_for([asked.answer], timeout=POLL).done:
            cost = _spent(self.process.pid) - before
        cost = max(cost, _spent(self.process.pid) - before)
        self.costs.append(min(cost, left))
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
