"""Notices as they may be shown, and those that keep coming told once."""

from __future__ import annotations

from collections.abc import Hashable

from rulec_runtime.live.limits import STOOD_STILL
from rulec_runtime.live.rows import Notice, NoticeKind
from rulec_runtime.live.sources import limits
from rulec_runtime.live.steady import steady
from rulec_runtime.output.terminal import one_line


def notice(
    kind: NoticeKind, time: float, text: str, *, still: bool = False, signal: str = ""
) -> Notice:
    """A notice whose text steers no terminal, whatever data stands in it."""
    short = text if len(text) <= limits.LONGEST_NOTICE else f"{text[: limits.LONGEST_NOTICE]}..."
    return Notice(kind, time, one_line(short), still, signal)


class Remarks:
    """What keeps coming is told once, and again after a while with how often it came.

    Keys are ours (a signal, a column), never taken from a payload, so there are few of them.
    """

    def __init__(self) -> None:
        self._told: dict[Hashable, tuple[float, int]] = {}

    def tell(self, kind: NoticeKind, key: Hashable, time: float, text: str) -> list[Notice]:
        """The notice, or nothing where it was told lately."""
        now = steady()
        since, count = self._told.get(key, (-float("inf"), 0))
        if now - since < limits.AGAIN:
            self._told[key] = (since, count + 1)
            return []
        self._told[key] = (now, 0)
        more = f" ({count} more times since this was told)" if count else ""
        return [notice(kind, time, f"{text}{more}")]


class Silence:
    """Whether nothing was heard for too long; told once, until something is heard again.

    Time in which nobody looked, as the process stood still or was busy, does not count.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.stale = False
        self._heard = self._looked = steady()

    @property
    def lasts(self) -> float:
        """Seconds since something was heard."""
        return steady() - self._heard

    def heard(self) -> bool:
        """Something was; whether it was stale until now."""
        was, self.stale = self.stale, False
        self._heard = steady()
        return was

    def begins(self) -> bool:
        """Whether it is stale from now on."""
        looked, self._looked = self._looked, steady()
        if self._looked - looked > STOOD_STILL:
            self._heard = min(self._heard + self._looked - looked, self._looked)
        if self.stale or self.lasts < self.seconds:
            return False
        self.stale = True
        return True
