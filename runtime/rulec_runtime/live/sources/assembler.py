"""Values of several places put together to rows.

A place is a server or, where each signal comes alone, a signal. A row is whole when every place
that is heard has said something since the last one; else it ends an interval after its first
value. Values hold until they are told anew or their place is lost. Signals without a value that can
be used are told at once, and as a check of function when it lasts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from threading import RLock

import numpy as np

from rulec_runtime.live.rows import Notice
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.handover import Handover
from rulec_runtime.live.sources.map import SourceMap
from rulec_runtime.live.sources.remarks import Remarks, Silence, notice
from rulec_runtime.live.steady import steady


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
        """Whether some place says nothing."""
        return len(self._heard) < len(self._silence)

    def found(self, place: str) -> None:
        """A place that was lost is connected again, which is told."""
        with self._lock:
            self._silence[place].heard()
            self._heard.add(place)

    def living(self, places: Iterable[str]) -> None:
        """Places that are there and have nothing new to say: their values hold."""
        with self._lock:
            for place in self._heard.intersection(places):
                self._silence[place].heard()

    def unusable(self, signal: str, why: str) -> None:
        """A signal has no value at all, which is told where it is new."""
        with self._lock:
            self._take(signal, float("nan"), why)

    def _take(self, signal: str, reading: float, why: str) -> None:
        self._values[self._index[signal]] = reading
        if told := self._unread.take(signal, why):
            self._hand.notices(told)

    def put(
        self, places: Iterable[str], values: Mapping[str, tuple[float, str]], time: float
    ) -> None:
        """What places say at a time, s since 1970; readings in SI, or NaN and why there is none."""
        with self._lock:
            here = set(places)
            if here & self._pending and time - self._first_time >= self._interval / 2:
                self._end_row()
            if not self._pending:
                self._first, self._first_time = steady(), time
            again = [place for place in here if self._silence[place].heard()]
            for name, (reading, why) in values.items():
                self._take(name, reading, why)
            self._heard |= here
            if again and not self.silent:
                text = "all values come again"
                self._hand.notices([notice("connected", steady.wall(), text)])
            self._pending |= here
            self._newest = max(self._newest, time)
            if self._pending >= self._heard:
                self._end_row()

    def lost(self, place: str) -> None:
        """A place says nothing any more: its signals have no reading."""
        with self._lock:
            self._heard.discard(place)
            self._pending.discard(place)
            gone = [name for name, of in self._place_of.items() if of == place]
            for name in gone:
                self._values[self._index[name]] = np.nan
            self._unread.begin(gone)

    def tick(self) -> None:
        """To be called now and then: rows that wait for a place end, silent places are told."""
        with self._lock:
            if self._pending and steady() - self._first >= self._interval:
                self._end_row()
            silent = [place for place, silence in self._silence.items() if silence.begins()]
            for place in silent:
                self.lost(place)
            if silent:
                seconds = max(self._silence[place].lasts for place in silent)
                names = f"{', '.join(silent)}: " if any(silent) else ""
                text = f"{names}no value for {seconds:.0f} s"
                self._hand.notices([notice("stale", steady.wall(), text)])
            read = [name for name, of in self._place_of.items() if of in self._heard]
            self._hand.notices(self._unread.lasting(read))

    def _end_row(self) -> None:
        """Hand a row out if it is later than the last; else its values stand in the next one."""
        self._pending = set()
        time, self._newest = self._newest, -float("inf")
        if time > self._last:
            self._last = time
            self._hand.row(time, self._values.copy())
        elif self._last - time > limits.LATE_INTERVALS * self._interval:
            text = (
                f"values are {self._last - time:.3g} s older than the last row; rows are left out"
            )
            self._hand.notices(self._remarks.tell("clock", "rows", steady.wall(), text))


@dataclass(frozen=True)
class _Bad:
    """Why a signal has no reading, since when for this reason and since when at all, s."""

    why: str
    since: float
    first: float


def usable(reading: float, why: str, largest: float) -> tuple[float, str]:
    """A reading that may be none, and `why`: also where no sensor reaches so far."""
    return (float("nan"), "beyond any sensor") if abs(reading) > largest else (reading, why)


class Unread:
    """Which signals have no usable reading, and why; it is a check of function from `seconds` on.

    A source that is not read is told as a whole, not by its signals.
    """

    def __init__(self, signals: Iterable[str], seconds: float) -> None:
        self._seconds = seconds
        self._bad: dict[str, _Bad] = {}
        self._told: dict[str, str] = {}
        self.begin(signals)

    def begin(self, signals: Iterable[str]) -> None:
        """Nothing is known of these until a value comes."""
        here = steady()
        self._bad |= dict.fromkeys(signals, _Bad("no value has come", here, here))

    def take(self, signal: str, why: str) -> list[Notice]:
        """A value came that can be used, or `why` not, which is told where it is new."""
        if not why:
            self._bad.pop(signal, None)
            self._told.pop(signal, None)
            return []
        here = steady()
        before = self._bad.get(signal)
        if before is not None and before.why == why:
            return []
        self._bad[signal] = _Bad(why, here, here if before is None else before.first)
        return [notice("refused", steady.wall(), f"{signal} has no reading: {why}")]

    def lasting(self, signals: Collection[str]) -> list[Notice]:
        """What is told of these from now on: that they have had no reading for too long, or that
        there is another reason by now."""
        found = []
        for signal, bad in self._bad.items():
            since = bad.since if signal in self._told else bad.first
            lasts = steady() - since
            if signal in signals and lasts >= self._seconds and self._told.get(signal) != bad.why:
                self._told[signal] = bad.why
                text = f"{signal} has had no reading for {lasts:.0f} s: {bad.why}"
                found.append(notice("stale", steady.wall(), text, signal=signal))
        return found
