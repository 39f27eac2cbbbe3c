"""Events on their way to a sink that may be full or gone: nothing lost, nothing twice.

A thread of its own writes, so the diagnosis never waits. While a sink cannot be written, what waits
is kept in memory and in a file beside it, and it is tried again and again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Condition, Thread
from typing import Protocol

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.journal.spill import Pending, spill, waiting
from rulec_runtime.live.steady import steady
from rulec_runtime.recordings.wall_clock import duration
from rulec_runtime.report.text import counted


class Sink(Protocol):
    """Somewhere that events are kept; what comes again is kept once."""

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool
    ) -> None:
        """Keep all or nothing. Raises `JournalTrouble` where it may work later, `JournalRefused`
        where it never will."""

    @property
    def place(self) -> str:
        """What it is, for people."""


class Outbox:
    """What waits for one sink.

    `say` gets lines for people, once per trouble, from another thread. `file` is where what waits
    outlives this process; what one before has left there is written first. Raises `JournalRefused`
    if that cannot be read.
    """

    def __init__(
        self,
        sink: Sink,
        plant: str,
        say: Callable[[str], None],
        *,
        dated: bool = True,
        file: Path | None = None,
        clock: Callable[[], float] = steady,
    ) -> None:
        self._sink, self._plant, self._say = sink, plant, say
        self.file, self._clock = file, clock
        left = Pending(dated=dated) if file is None else waiting(file, plant)
        self.dated = left.dated if left.events else dated
        """Are times of events s since 1970? A source may know that from its first rows on."""
        self._events: list[Event] = list(left.events)
        self._state = left.state
        self._spilled = bool(left.events)
        self._changes = self._kept = 0  # counts what was put; how much of it is in the file
        self._trouble: float | None = None  # since when, by the clock
        self._wait = limits.FIRST_RETRY
        self._due = self._spill_due = self._written = clock()
        self._ends = float("inf")
        self._refused: str | None = None
        self._changed = Condition()
        self._thread: Thread | None = None

    @property
    def left(self) -> tuple[int, bytes] | None:
        """The state that waits to be written and the number of the last event before it: a watcher
        that starts goes on from there, unless that of the sink is newer. None if none waits."""
        with self._changed:
            state = self._state
            return (self._events[-1].number, state) if self._events and state is not None else None

    @property
    def place(self) -> str:
        """What it writes to, for people."""
        return self._sink.place

    @property
    def newest(self) -> int:
        """Number of the last event that waits; 0 if none does."""
        with self._changed:
            return self._events[-1].number if self._events else 0

    @property
    def pending(self) -> int:
        """How many events wait to be written."""
        with self._changed:
            return len(self._events)

    def put(self, events: Sequence[Event], state: bytes | None = None) -> None:
        """Hand over events, and the state after them; returns at once.

        Raises `JournalRefused` if the sink takes nothing any more, `JournalTrouble` if so much
        waits already that no more is taken.
        """
        with self._changed:
            if self._refused is not None:
                raise JournalRefused(self._refused)
            if events and len(self._events) + len(events) > limits.MOST_PENDING:
                raise JournalTrouble(
                    f"{self.place}: {len(self._events)} events wait to be written, no more "
                    "are taken"
                )
            self._events.extend(events)
            self._state = state if state is not None or events else self._state
            self._changes += 1
            self._changed.notify_all()

    def settle(self, patience: float = limits.BUSY) -> None:
        """Wait until all that was put is written, or it is known that it must wait."""

        def settled() -> bool:
            return self._idle() or self._trouble is not None or self._refused is not None

        with self._changed:
            self._changed.wait_for(settled, patience)

    def start(self) -> None:
        """Write in a thread of its own from now on."""
        self._thread = Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def close(self, patience: float = limits.BUSY) -> int:
        """Write what waits, as far as that works within so many seconds; how many events wait on in
        the file."""
        with self._changed:
            self._due, self._wait = self._clock(), limits.FIRST_RETRY
            self._ends = self._due + patience
            self._changed.notify_all()
        if self._thread is None:
            self._run()
        else:
            self._thread.join(patience + limits.CONNECT)
        return self.pending

    def step(self) -> float:
        """One try, if it is time for one; s until the next one."""
        now = self._clock()
        with self._changed:
            pending = Pending(tuple(self._events), self._state, self.dated)
            changes = self._changes
        idle = not pending.events and pending.state is None and now < self._written + limits.RENEWED
        if idle or self._refused is not None:
            return limits.RENEWED
        if self._trouble is not None:
            self._keep(pending, changes)  # before a try that may take long
        if now >= self._due:
            try:
                self._sink.commit(self._plant, pending.events, pending.state, dated=pending.dated)
            except JournalTrouble as error:
                self._failed(str(error), now)
            except JournalRefused as error:
                self._stopped(str(error))
            except Exception as error:  # a bug of ours must not end the diagnosis, nor be silent
                self._stopped(f"{self.place}: {type(error).__name__}: {error}")
            else:
                self._done(pending, changes, now)
                return limits.RENEWED if self._idle() else 0.0
            self._keep(pending, changes)
        due = self._due if self._kept == changes else min(self._due, self._spill_due)
        return max(due - self._clock(), 0.0)

    def _run(self) -> None:
        while True:
            with self._changed:
                seen = self._changes
            wait = self.step()
            with self._changed:
                closing = self._ends < float("inf")
                over = self._idle() or self._refused is not None or self._clock() >= self._ends
                if closing and over:
                    return
                if self._changes == seen:
                    self._changed.wait(min(wait, limits.FIRST_RETRY) if closing else wait)

    def _idle(self) -> bool:
        return not self._events and self._state is None

    def _failed(self, reason: str, now: float) -> None:
        if self._trouble is None:
            self._trouble, self._wait = now, limits.FIRST_RETRY
            self._say(f"{reason}; events are kept and written when it works again")
        self._due = self._clock() + self._wait
        self._wait = min(2 * self._wait, limits.LAST_RETRY)
        self._notify()

    def _stopped(self, reason: str) -> None:
        self._refused = reason
        self._spill_due = self._clock()
        self._say(reason)
        self._notify()

    def _notify(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _done(self, pending: Pending, changes: int, now: float) -> None:
        with self._changed:
            del self._events[: len(pending.events)]
            if self._changes == changes:
                self._state = None
            self._changed.notify_all()
        self._written = now
        if self._spilled and self.file is not None:
            with suppress(OSError):  # what stands there is written again, which changes nothing
                self.file.unlink(missing_ok=True)
                self._spilled = False
        if self._trouble is not None:
            lasted = duration(now - self._trouble)
            self._trouble, count = None, len(pending.events)
            what = f", with {counted(count, 'event')} that waited" if count else ""
            self._say(f"{self.place}: written again after {lasted}{what}")

    def _keep(self, pending: Pending, changes: int) -> None:
        """What waits goes into the file, as a whole, as often as that takes little of the time."""
        began = self._clock()
        if self.file is None or not pending.events or self._kept == changes:
            self._kept = changes
            return
        if began < self._spill_due:
            return
        with suppress(OSError):  # where the disk is full here as well, memory has it all
            spill(self.file, self._plant, pending)
            self._spilled = True
            self._kept = changes
        now = self._clock()
        self._spill_due = now + max((now - began) / limits.SPILL_SHARE, limits.SPILL_PAUSE)
