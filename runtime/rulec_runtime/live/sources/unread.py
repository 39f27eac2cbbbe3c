"""Signals whose values cannot be used while their source is read: told at once, and as a check of
function when it lasts."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from rulec_runtime.live.rows import Notice
from rulec_runtime.live.sources.handover import now
from rulec_runtime.live.sources.remarks import notice
from rulec_runtime.live.steady import steady


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
        return [notice("refused", now(), f"{signal} has no reading: {why}")]

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
                found.append(notice("stale", now(), text, signal=signal))
        return found
