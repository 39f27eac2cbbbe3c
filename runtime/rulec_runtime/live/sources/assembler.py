"""Assemble values of several places into rows, and hand these to the thread that takes rows.

A place is a server or, if signals come separately, a signal. A row is complete when every connected
place has sent something since the last row, or an interval after its first value. Values hold until
new ones come or their place is lost. A signal without a usable value is reported at once, and as
check function if that lasts.
"""

import time as clocks
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from threading import Condition, RLock

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import SourceMap
from rulec_runtime.live.sources.remarks import Remarks, Silence, notice
from rulec_runtime.output.plural import plural


class Handover:
    """Rows and notices in order of arrival.

    If nobody takes them in time, the oldest rows are dropped with a notice 'gap'.
    """

    def __init__(self, signals: Sequence[str]) -> None:
        self._signals = tuple(signals)
        self._came: deque[Rows | Notice] = deque()
        self._count = self._dropped = 0
        self._since = 0.0
        self._changed = Condition()

    def row(self, time: float, values: Array) -> None:
        """Add a row: its time, s, and the readings of the signals in their order, SI."""
        columns = dict(zip(self._signals, values.reshape(-1, 1).copy(), strict=True))
        with self._changed:
            self._came.append(Rows(np.array([time]), columns))
            self._count += 1
            if self._count > limits.QUEUED_ROWS:
                place, gone = next(
                    (i, float(one.time[0]))
                    for i, one in enumerate(self._came)
                    if isinstance(one, Rows)
                )
                del self._came[place]
                self._since = self._since if self._dropped else gone
                self._count, self._dropped = self._count - 1, self._dropped + 1
            self._changed.notify()

    def notices(self, found: Sequence[Notice]) -> None:
        with self._changed:
            self._came.extend(found)
            self._changed.notify()

    def take(self, seconds: float) -> list[Rows | Notice]:
        """Everything in the queue, after waiting at most so many seconds for it."""
        with self._changed:
            if not self._came:
                self._changed.wait(seconds)
            came, self._came, self._count = self._came, deque(), 0
            dropped, self._dropped = self._dropped, 0
        if dropped:
            text = f"{plural(dropped, 'row was', 'rows were')} dropped: nobody took them in time"
            came.appendleft(notice("gap", self._since, text))
        return list(came)


class Assembler:
    """Rows from values; `place_of` names the place of each signal."""

    def __init__(
        self, source: SourceMap, place_of: Mapping[str, str], hand: Handover, remarks: Remarks
    ) -> None:
        self._interval = source.interval
        self._hand, self._remarks = hand, remarks
        self._index = {name: i for i, name in enumerate(place_of)}
        self._place_of = place_of
        self._values = np.full(len(place_of), np.nan)
        self._silence = {place: Silence(source.stale) for place in place_of.values()}
        self._heard = set(self._silence)
        self._unread = Unread(place_of, source.stale)
        self._pending: set[str] = set()
        self._first = self._first_time = 0.0
        self._newest = self._last = -float("inf")
        self._lock = RLock()

    @property
    def begun(self) -> bool:
        """Whether there was a row."""
        return self._last > -float("inf")

    @property
    def silent(self) -> bool:
        """Whether some place is silent."""
        return len(self._heard) < len(self._silence)

    def found(self, place: str) -> None:
        """A lost place is connected again; the caller reports it."""
        with self._lock:
            self._silence[place].heard()
            self._heard.add(place)

    def living(self, places: Iterable[str]) -> None:
        """Places are connected but have no new values: the old ones hold."""
        with self._lock:
            for place in self._heard.intersection(places):
                self._silence[place].heard()

    def unusable(self, signal: str, why: str) -> None:
        """A signal has no value, which is reported if it is new."""
        with self._lock:
            self._take(signal, float("nan"), why)

    def _take(self, signal: str, reading: float, why: str) -> None:
        self._values[self._index[signal]] = reading
        if notices := self._unread.take(signal, why):
            self._hand.notices(notices)

    def put(
        self, places: Iterable[str], values: Mapping[str, tuple[float, str]], time: float
    ) -> None:
        """New values of places at a time, s since 1970: readings in SI, or NaN and the reason."""
        with self._lock:
            here = set(places)
            if here & self._pending and time - self._first_time >= self._interval / 2:
                self._end_row()
            if not self._pending:
                self._first, self._first_time = clocks.monotonic(), time
            again = [place for place in here if self._silence[place].heard()]
            for name, (reading, why) in values.items():
                self._take(name, reading, why)
            self._heard |= here
            if again and not self.silent:
                text = "all values come again"
                self._hand.notices([notice("connected", clocks.time(), text)])
            self._pending |= here
            self._newest = max(self._newest, time)
            if self._pending >= self._heard:
                self._end_row()

    def lost(self, place: str) -> None:
        """A place is lost: its signals have no reading."""
        with self._lock:
            self._heard.discard(place)
            self._pending.discard(place)
            gone = [name for name, of in self._place_of.items() if of == place]
            for name in gone:
                self._values[self._index[name]] = np.nan
            self._unread.begin(gone)

    def tick(self) -> None:
        """Call this periodically: it ends rows that wait for a place, and reports silent places."""
        with self._lock:
            if self._pending and clocks.monotonic() - self._first >= self._interval:
                self._end_row()
            silent = [place for place, silence in self._silence.items() if silence.begins()]
            for place in silent:
                self.lost(place)
            if silent:
                seconds = max(self._silence[place].lasts for place in silent)
                names = f"{', '.join(silent)}: " if any(silent) else ""
                text = f"{names}no value for {seconds:.0f} s"
                self._hand.notices([notice("stale", clocks.time(), text)])
            read = [name for name, of in self._place_of.items() if of in self._heard]
            self._hand.notices(self._unread.lasting(read))

    def _end_row(self) -> None:
        """Hand out the row if it is later than the last; otherwise the next row has its values."""
        self._pending = set()
        time, self._newest = self._newest, -float("inf")
        if time > self._last:
            self._last = time
            self._hand.row(time, self._values)
        elif self._last - time > limits.LATE_INTERVALS * self._interval:
            text = (
                f"values are {self._last - time:.3g} s older than the last row; rows are left out"
            )
            self._hand.notices(self._remarks.tell("clock", "rows", clocks.time(), text))


@dataclass(frozen=True)
class _Bad:
    """Why a signal has no reading, since when for this reason, and since when at all, s."""

    why: str
    since: float
    first: float


def usable(reading: float, why: str, largest: float) -> tuple[float, str]:
    """A reading and `why` it is unusable, also if it is beyond any sensor, or no number."""
    if abs(reading) > largest:
        return float("nan"), "beyond any sensor"
    return reading, why or ("no number" if isnan(reading) else "")


class Unread:
    """Signals without a usable reading, and why; after `seconds` that is check function.

    A source that is not read is reported as a whole, not by its signals.
    """

    def __init__(self, signals: Iterable[str], seconds: float) -> None:
        self._seconds = seconds
        self._bad: dict[str, _Bad] = {}
        self._reported: dict[str, str] = {}
        self.begin(signals)

    def begin(self, signals: Iterable[str]) -> None:
        """These signals have no reading until a value comes."""
        now = clocks.monotonic()
        self._bad |= dict.fromkeys(signals, _Bad("no value has come", now, now))

    def take(self, signal: str, why: str) -> list[Notice]:
        """A usable value came, or `why` it is unusable, which is reported if it is new."""
        if not why:
            self._bad.pop(signal, None)
            self._reported.pop(signal, None)
            return []
        now = clocks.monotonic()
        before = self._bad.get(signal)
        if before is not None and before.why == why:
            return []
        self._bad[signal] = _Bad(why, now, now if before is None else before.first)
        return [notice("refused", clocks.time(), f"{signal} has no reading: {why}")]

    def lasting(self, signals: Collection[str]) -> list[Notice]:
        """New notices that signals have had no reading for too long, or for another reason."""
        found = []
        for signal, bad in self._bad.items():
            reported = self._reported.get(signal)
            lasts = clocks.monotonic() - (bad.first if reported is None else bad.since)
            if signal in signals and lasts >= self._seconds and reported != bad.why:
                self._reported[signal] = bad.why
                text = f"{signal} has had no reading for {lasts:.0f} s: {bad.why}"
                found.append(notice("stale", clocks.time(), text, signal=signal))
        return found
