"""What a source gives: rows of readings, and remarks on the way they came."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

from rulec_runtime.contract.plan import Array

NoticeKind = Literal["connected", "lost", "gap", "stale", "refused", "clock", "ended"]


@dataclass(frozen=True)
class Rows:
    """Readings in order of time.

    Attributes
    ----------
    time : shape (n,), s since 1970 in UTC, or of the source's own clock; increasing.
    values : per signal id an array, shape (n,), SI; NaN where there is no usable reading.
    """

    time: Array
    values: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Notice:
    """What happened to the connection at a time (as of rows), for the operator.

    `still`: though something is connected, something else of the source is not read. `signal`: the
    one that it is about, where that is not the whole source.
    """

    kind: NoticeKind
    time: float
    text: str
    still: bool = False
    signal: str = ""


class Source(Protocol):
    """Somewhere that rows come from; it only ever reads."""

    @property
    def dated(self) -> bool:
        """Are its times s since 1970 in UTC?"""

    @property
    def ended(self) -> bool:
        """Will nothing come any more?"""

    def take(self, seconds: float) -> list[Rows | Notice]:
        """What has come, waiting for it no longer than this; nothing is an empty list."""

    def close(self) -> None:
        """Leave the plant alone."""
