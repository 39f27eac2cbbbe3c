"""Events and acknowledgements on their way to a sink that may be full or gone: none is lost, and
none is written twice.

A separate thread writes, so the diagnosis never waits. While the sink fails, they wait in memory
and in a file beside it, so that they survive the process, and the write is retried.
"""

import base64
import dataclasses
import hashlib
import json
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Condition, Thread
from typing import Any, Protocol

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.event_records import event_of, record_of, storable
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.moment import Now
from rulec_runtime.output.json_file import Damaged, digest_of, read_json
from rulec_runtime.output.write_file import written
from rulec_runtime.recordings.plant_calendar import duration
from rulec_runtime.report.text import counted


@dataclass(frozen=True)
class Note:
    """An acknowledgement of an episode, `at` s since 1970."""

    episode: str
    by: str
    at: float


@dataclass(frozen=True)
class Pending:
    """Events in order, the state of the watcher after the last, and acknowledgements; `dated` if
    times are s since 1970."""

    events: tuple[Event, ...] = ()
    state: bytes | None = None
    dated: bool = True
    notes: tuple[Note, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.events or self.notes or self.state is not None)


def spill_beside(path: Path, plant: str) -> Path:
    """The usual path for what waits, beside a journal or a file of lines."""
    short = hashlib.sha256(plant.encode("utf-8", "replace")).hexdigest()[:8]
    return path.with_name(f"{path.name}.{short}.waiting.json")


def spill(file: Path, plant: str, pending: Pending) -> None:
    """Save what waits, as a whole; raises OSError."""
    state, dated = pending.state, pending.dated
    data: dict[str, Any] = {
        "plant": plant,
        "dated": dated,
        "events": [
            record_of(event, dated) | {"growth": storable(event.episode.growth)}
            for event in pending.events
        ],
        "state": None if state is None else base64.b64encode(state).decode(),
        "notes": [dataclasses.astuple(note) for note in pending.notes],
    }
    data["digest"] = digest_of(data)
    with written(file) as stream:
        json.dump(data, stream, allow_nan=False)
        stream.flush()
        os.fsync(stream.fileno())


def waiting(file: Path, plant: str) -> Pending:
    """What was saved; nothing if there is no file.

    Raises `JournalRefused` for a file of another plant, or one that somebody has changed.
    """
    try:
        data = read_json(file)
        if data["digest"] != digest_of(data):
            raise Damaged("somebody has changed it")
        if data["plant"] != plant:
            raise Damaged(f"its events are those of {data['plant']}, not of {plant}")
        state = data["state"]
        return Pending(
            tuple(event_of(record) for record in data["events"]),
            None if state is None else base64.b64decode(state, validate=True),
            bool(data["dated"]),
            tuple(Note(str(name), str(by), float(at)) for name, by, at in data.get("notes", ())),
        )
    except FileNotFoundError:
        return Pending()
    except (Damaged, JournalRefused, KeyError, TypeError, ValueError, AttributeError) as error:
        reason = str(error) if isinstance(error, Damaged) else "it is none that rulec wrote"
        raise JournalRefused(
            f"{file} should hold events that wait to be written, but {reason}; move it away to "
            "start without them"
        ) from None
    except OSError as error:
        raise JournalRefused(f"{file}: {error.strerror or error}") from None


class Sink(Protocol):
    """A destination of events, which ignores repeated ones."""

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool
    ) -> None:
        """Store all or nothing. Raises `JournalTrouble` if it may work later, `JournalRefused` if
        it never will."""

    @property
    def address(self) -> str:
        """Its name, for people."""


class Outbox:
    """The queue of one sink; a destination of a watch, which ends if it accepts no more.

    `say` gets lines for people, once per trouble, from another thread. `file` saves what waits
    beyond the end of the process; the rest of an earlier process is written first. If it goes
    `ahead`, events and state are in the file before the sink gets them, which does not store both
    at once: after a kill in between they are written again; and `put` waits until they are stored,
    unless the sink fails. `noting` writes
    acknowledgements, after the events; it is also called every few seconds without any, and raises
    `JournalTrouble`. Raises `JournalRefused` if the file cannot be read.
    """

    def __init__(
        self,
        sink: Sink,
        plant: str,
        say: Callable[[str], None],
        *,
        file: Path | None,
        ahead: bool = False,
        noting: Callable[[Sequence[Note]], None] = lambda _: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sink, self._plant, self._say, self._noting = sink, plant, say, noting
        self.file, self._ahead, self._clock = file, ahead, clock
        self._pending = Pending() if file is None else waiting(file, plant)
        self.written = 0
        """Number of the last event that is stored already, and not taken again."""
        self._filed = self._pending or None  # what is in the file
        self._trouble: float | None = None  # since when the sink fails, by the clock
        self._wait = limits.FIRST_RETRY
        self._due = self._spill_due = self._written = clock()
        self._ends = float("inf")
        self._refused: str | None = None
        self._changed = Condition()
        self._thread: Thread | None = None

    @property
    def left(self) -> tuple[int, bytes] | None:
        """The pending state and the number of the last event before it; None without one. A watcher
        starts from it, unless the state of the sink is newer."""
        left = self._pending
        if not left.events or left.state is None:
            return None
        return left.events[-1].number, left.state

    @property
    def address(self) -> str:
        """Name of the sink, for people."""
        return self._sink.address

    @property
    def newest(self) -> int:
        """Number of the last pending event; 0 without one."""
        events = self._pending.events
        return events[-1].number if events else 0

    @property
    def pending(self) -> int:
        """Number of pending events and acknowledgements."""
        return len(self._pending.events) + len(self._pending.notes)

    @property
    def noted(self) -> frozenset[str]:
        """Ids of the episodes whose acknowledgements wait."""
        return frozenset(note.episode for note in self._pending.notes)

    def summary(self) -> str:
        """What waits, for people."""
        events, notes = self._pending.events, self._pending.notes
        counts = ((len(events), "event"), (len(notes), "acknowledgement"))
        return " and ".join(counted(number, what) for number, what in counts if number)

    def put(self, new: Sequence[Event], state: bytes | None = None, *, dated: bool = True) -> None:
        """Add events, and the state after them.

        Raises `JournalRefused` if the sink has refused for good, `JournalTrouble` if the queue is
        full.
        """
        with self._changed:
            if self._refused is not None:
                raise JournalRefused(self._refused)
            before = self._pending
            fresh = [event for event in new if event.number > self.written]
            if fresh and len(before.events) + len(fresh) > limits.MOST_PENDING:
                raise JournalTrouble(
                    f"{self.address}: {len(before.events)} events wait to be written, no more "
                    "are taken"
                )
            state = before.state if state is None and not fresh else state
            events = (*before.events, *fresh)
            self._pending = replace(before, events=events, state=state, dated=dated)
            self._changed.notify_all()
            if self._ahead:
                self._changed.wait_for(self._settled, limits.BUSY)

    def _settled(self) -> bool:
        """Whether nothing waits, or nothing is accepted now."""
        return not self._pending or self._trouble is not None or self._refused is not None

    def show(self, now: Now) -> None:
        """Only what has changed is stored."""

    def note(self, episode: str, by: str) -> None:
        """Acknowledge an episode; returns at once."""
        with self._changed:
            if episode not in self.noted:
                notes = (*self._pending.notes, Note(episode, by, time.time()))
                self._pending = replace(self._pending, notes=notes)
                self._changed.notify_all()

    def start(self) -> None:
        """Start the thread that writes."""
        self._thread = Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def close(self, patience: float | None = None) -> int:
        """Write what waits as far as possible within so many seconds; returns the number of events
        and acknowledgements that are still pending."""
        patience = limits.BUSY if patience is None else patience
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
        """Try to write, if that is due; returns the s until the next attempt."""
        now, pending = self._clock(), self._pending
        idle = not pending and now < self._written + limits.RENEWED
        if idle or self._refused is not None:
            return limits.RENEWED
        if self._trouble is not None:
            self._keep(pending)  # before an attempt that may take long
        if now >= self._due:
            try:
                if self._ahead and pending.events:
                    self._save(pending)
                self._sink.commit(self._plant, pending.events, pending.state, dated=pending.dated)
                self._noting(pending.notes)
            except (JournalTrouble, OSError) as error:
                if self._trouble is None:
                    self._trouble, self._wait = now, limits.FIRST_RETRY
                    what, why = f"{error}", getattr(error, "strerror", None)
                    what = f"{self.address}: {why}" if why else what
                    self._say(f"{what}; events are kept and written when it works again")
                self._due = self._clock() + self._wait
                self._wait = min(2 * self._wait, limits.LAST_RETRY)
            except Exception as error:  # a bug of ours must neither end the diagnosis nor be silent
                of_ours = f"{self.address}: {type(error).__name__}: {error}"
                self._refused = str(error) if isinstance(error, JournalRefused) else of_ours
                self._spill_due = self._clock()
                self._say(self._refused)
            else:
                self._done(pending, now)
                return 0.0 if self._pending else limits.RENEWED
            with self._changed:
                self._changed.notify_all()
            self._keep(pending)
        due = min(self._due, self._spill_due) if self._unfiled(pending) else self._due
        return max(due - self._clock(), 0.0)

    def _run(self) -> None:
        while True:
            before = self._pending
            wait = self.step()
            with self._changed:
                closing = self._ends < float("inf")
                over = not self._pending or self._refused is not None or self._clock() >= self._ends
                if closing and over:
                    break
                if self._pending is before:
                    self._changed.wait(min(wait, limits.FIRST_RETRY) if closing else wait)
        self._spill_due = self._clock()  # nothing comes after this: the file must have all
        self._keep(self._pending)

    def _done(self, pending: Pending, now: float) -> None:
        with self._changed:
            left = self._pending  # others may have come meanwhile
            self._pending = replace(
                left,
                events=left.events[len(pending.events) :],
                notes=left.notes[len(pending.notes) :],
                state=None if left.state is pending.state else left.state,
            )
            self._changed.notify_all()
        self._written = now
        if self._filed is not None and self.file is not None:
            with suppress(OSError):  # its events would be written again, which changes nothing
                self.file.unlink(missing_ok=True)
                self._filed = None
        if self._trouble is not None:
            lasted = duration(now - self._trouble)
            self._trouble, count = None, len(pending.events)
            what = f", with {counted(count, 'event')} that waited" if count else ""
            self._say(f"{self.address}: written again after {lasted}{what}")

    def _unfiled(self, pending: Pending) -> bool:
        """Whether something waits that the file should have, and has not."""
        waits = pending.events or pending.notes
        return bool(waits) and self.file is not None and self._filed is not pending

    def _save(self, pending: Pending) -> None:
        if self.file is not None:
            spill(self.file, self._plant, pending)
            self._filed = pending

    def _keep(self, pending: Pending) -> None:
        """Save what waits in the file as a whole, but only as often as that takes little time."""
        began = self._clock()
        if self._unfiled(pending) and began >= self._spill_due:
            with suppress(OSError):  # if this disk is full as well, memory still has everything
                self._save(pending)
            now = self._clock()
            pause = max((now - began) / limits.SPILL_SHARE, limits.SPILL_PAUSE)
            self._spill_due = now + pause
