"""Assemble values of several senders into rows, and hand these to the thread that takes rows.

A sender is a server or, if signals come separately, a signal. A row is complete when each connected
sender has sent something since the last row, or an interval after its first value. Values hold
until new ones come or their sender is lost. A signal without a usable value is reported at once,
and as check function if that lasts.
"""

import time as clocks
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan, nan
from threading import Condition, RLock

import numpy as np

from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import SourceMap
from rulec_runtime.live.sources.remarks import Remarks, Silence, notice
from rulec_runtime.output.plural import plural


class Handover:
    """Rows and notices in order of arrival.

    If nobody takes them in time, the oldest rows are dropped with a notice 'gap'.
    """

    def __init__(self) -> None:
        self._came: list[Rows | Notice] = []
        self._rows = self._dropped = 0
        self._since = 0.0
        self._changed = Condition()

    def row(self, time: float, values: Mapping[str, float]) -> None:
        """Add a row: its time, s, and the readings of the signals, SI."""
        columns = {name: np.array([value]) for name, value in values.items()}
        with self._changed:
            self._came.append(Rows(np.array([time]), columns))
            self._rows += 1
            if self._rows - self._dropped > limits.QUEUED_ROWS:
                oldest = next(one for one in self._came if isinstance(one, Rows))
                self._came.remove(oldest)
                self._since = self._since if self._dropped else float(oldest.time[0])
                self._dropped += 1
            self._changed.notify()

    def notices(self, found: Sequence[Notice]) -> None:
        if found:
            with self._changed:
                self._came.extend(found)
                self._changed.notify()

    def take(self, seconds: float) -> list[Rows | Notice]:
        """Everything in the queue, after waiting at most so many seconds for it."""
        with self._changed:
            if not self._came:
                self._changed.wait(seconds)
            came, self._came, self._rows = self._came, [], 0
            dropped, self._dropped = self._dropped, 0
        if dropped:
            text = f"{plural(dropped, 'row was', 'rows were')} dropped: nobody took them in time"
            came.insert(0, notice("gap", self._since, text))
        return came


def usable(reading: float, why: str, largest: float) -> tuple[float, str]:
    """A reading and `why` it is unusable, also if it is beyond any sensor, or no number."""
    if abs(reading) > largest:
        return nan, "beyond any sensor"
    return reading, why or ("no number" if isnan(reading) else "")


@dataclass
class _Missing:
    """Why a signal has no reading, since when for this reason, and since when at all, s; the reason
    last `reported` as check function."""

    why: str
    since: float
    first: float
    reported: str = ""


class Assembler:
    """Rows from values; `sender_of` names the sender of each signal.

    A source that is not read is reported as a whole, not by its signals; a signal that comes on its
    own and is silent while others are not, by itself.
    """

    def __init__(
        self, source: SourceMap, sender_of: Mapping[str, str], hand: Handover, remarks: Remarks
    ) -> None:
        self._interval, self._stale = source.interval, source.stale
        self._hand, self._remarks = hand, remarks
        self._sender_of = sender_of
        self._values = dict.fromkeys(sender_of, nan)
        self._silence = {sender: Silence(source.stale) for sender in sender_of.values()}
        self._heard = set(self._silence)
        self._missing: dict[str, _Missing] = {}
        self._pending: set[str] = set()
        self._first = self._first_time = 0.0
        self._newest = self._last = -inf
        self._lock = RLock()
        for sender in self._silence:
            self._take_away(sender)

    @property
    def begun(self) -> bool:
        """Whether there was a row."""
        return self._last > -inf

    @property
    def silent(self) -> bool:
        """Whether some sender is silent."""
        return len(self._heard) < len(self._silence)

    def found(self, sender: str) -> None:
        """A lost sender is connected again; the caller reports it."""
        with self._lock:
            self._silence[sender].heard()
            self._heard.add(sender)

    def living(self, senders: Iterable[str]) -> None:
        """Senders are connected but have no new values: the old ones hold."""
        with self._lock:
            for sender in self._heard.intersection(senders):
                self._silence[sender].heard()

    def take(self, signal: str, reading: float, why: str) -> None:
        """The reading of a signal, or `why` it has none, which is reported if it is new."""
        with self._lock:
            self._values[signal] = reading
            before, now = self._missing.pop(signal, None), clocks.monotonic()
            if not why:
                return
            if before is None or before.why != why:
                first, reported = (before.first, before.reported) if before else (now, "")
                before = _Missing(why, now, first, reported)
                text = f"{signal} has no reading: {why}"
                self._hand.notices([notice("refused", clocks.time(), text)])
            self._missing[signal] = before

    def put(
        self, senders: Iterable[str], values: Mapping[str, tuple[float, str]], time: float
    ) -> None:
        """New values of senders at a time, s since 1970: readings in SI, or NaN and the reason."""
        with self._lock:
            here = set(senders)
            if here & self._pending and time - self._first_time >= self._interval / 2:
                self._end_row()
            if not self._pending:
                self._first, self._first_time = clocks.monotonic(), time
            again = [sender for sender in here if self._silence[sender].heard()]
            for name, (reading, why) in values.items():
                self.take(name, reading, why)
            self._heard |= here
            if again and not self.silent:
                text = "all values come again"
                self._hand.notices([notice("connected", clocks.time(), text)])
            self._pending |= here
            self._newest = max(self._newest, time)
            if self._pending >= self._heard:
                self._end_row()

    def lost(self, sender: str) -> None:
        """A sender is lost: its signals have no reading."""
        with self._lock:
            self._heard.discard(sender)
            self._pending.discard(sender)
            self._take_away(sender)

    def _take_away(self, sender: str) -> None:
        now = clocks.monotonic()
        for name in (name for name, of in self._sender_of.items() if of == sender):
            self._values[name] = nan
            reported = self._missing[name].reported if name in self._missing else ""
            self._missing[name] = _Missing("no value has come", now, now, reported)

    def tick(self) -> None:
        """Call this periodically: it ends rows that wait for a sender, and reports silent ones,
        and signals without a reading for too long, or for another reason."""
        with self._lock:
            now, found = clocks.monotonic(), []
            if self._pending and now - self._first >= self._interval:
                self._end_row()
            silent = {p: s.lasts for p, s in self._silence.items() if s.begins()}
            for sender in silent:
                self.lost(sender)
            # Silent alone, while others still come, is a matter of that signal.
            others = any(self._silence[sender].lasts < self._stale / 2 for sender in self._heard)
            alone = {sender for sender in silent if others and self._single(sender)}
            if whole := [sender for sender in silent if sender not in alone]:
                names = f"{', '.join(whole)}: " if any(whole) else ""
                text = f"{names}no value for {max(silent[sender] for sender in whole):.0f} s"
                found.append(notice("stale", clocks.time(), text))
            for signal, one in self._missing.items():
                sender = self._sender_of[signal]
                lasts = silent.get(sender, now - (one.since if one.reported else one.first))
                heard = sender in self._heard and lasts >= self._stale and one.reported != one.why
                if heard or sender in alone:
                    one.reported = one.why
                    text = f"{signal} has had no reading for {lasts:.0f} s: {one.why}"
                    found.append(notice("stale", clocks.time(), text, signal=signal))
            self._hand.notices(found)

    def _single(self, sender: str) -> bool:
        """Whether a sender is one signal among others."""
        return list(self._sender_of.values()).count(sender) == 1

    def _end_row(self) -> None:
        """Hand out the row if it is later than the last; otherwise the next row has its values."""
        self._pending = set()
        time, self._newest = self._newest, -inf
        if time > self._last:
            self._last = time
            self._hand.row(time, self._values)
        elif self._last - time > limits.LATE_INTERVALS * self._interval:
            text = (
                f"values are {self._last - time:.3g} s older than the last row; rows are left out"
            )
            self._hand.notices(self._remarks.tell("clock", "rows", clocks.time(), text))
