"""What a source says: refusals, notices with safe text, recurring remarks, and silence."""

import time as clocks
from collections.abc import Hashable
from types import ModuleType

from rulec_runtime.live.limits import STOOD_STILL
from rulec_runtime.live.rows import Notice, NoticeKind
from rulec_runtime.live.sources import limits
from rulec_runtime.output.refusal import to_install
from rulec_runtime.output.terminal import one_line
from rulec_runtime.recordings.csv_table import RecordingRefused


class SourceRefused(RecordingRefused):
    """A source cannot be used; the message says why and what to do."""


def extra(name: str, of: str) -> ModuleType:
    """Import a module of an extra `of` rulec-runtime. Raises `SourceRefused` without it."""
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError:
        raise SourceRefused(
            f"the package '{name.partition('.')[0]}' is missing: {to_install(of)}"
        ) from None


def notice(
    kind: NoticeKind, time: float, text: str, *, still: bool = False, signal: str = ""
) -> Notice:
    """A notice whose text cannot control a terminal, whatever data it contains."""
    short = text if len(text) <= limits.LONGEST_NOTICE else f"{text[: limits.LONGEST_NOTICE]}..."
    return Notice(kind, time, one_line(short), still, signal)


class Remarks:
    """Recurring remarks are reported once, and again after a while with their count.

    Keys are our own (a signal, a column), never from a payload, so there are few of them.
    """

    def __init__(self) -> None:
        self._reported: dict[Hashable, tuple[float, int]] = {}

    def tell(self, kind: NoticeKind, key: Hashable, time: float, text: str) -> list[Notice]:
        """The notice, or nothing if it was reported recently."""
        now = clocks.monotonic()
        since, count = self._reported.get(key, (-float("inf"), 0))
        if now - since < limits.AGAIN:
            self._reported[key] = (since, count + 1)
            return []
        self._reported[key] = (now, 0)
        more = f" ({count} more times since this was told)" if count else ""
        return [notice(kind, time, f"{text}{more}")]


class Silence:
    """Detects that nothing was heard for too long; reported once per silence.

    Time in which the process stood still or was too busy to check does not count.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.stale = False
        self._heard = self._checked = clocks.monotonic()

    @property
    def lasts(self) -> float:
        """Seconds since something was heard."""
        return clocks.monotonic() - self._heard

    def heard(self) -> bool:
        """Record that something was heard; returns whether the source was stale until now."""
        was, self.stale = self.stale, False
        self._heard = clocks.monotonic()
        return was

    def begins(self) -> bool:
        """Whether the source has just become stale."""
        checked, self._checked = self._checked, clocks.monotonic()
        if self._checked - checked > STOOD_STILL:
            self._heard = min(self._heard + self._checked - checked, self._checked)
        if self.stale or self.lasts < self.seconds:
            return False
        self.stale = True
        return True
