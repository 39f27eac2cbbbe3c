"""Output of a source: rows of readings, and notices about the connection."""

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
    values : per signal id an array, shape (n,), SI; NaN without a usable reading.
    """

    time: Array
    values: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Notice:
    """A change of the connection at a time (as of rows), for the operator.

    `still`: other parts of the source are still not read. `signal`: the signal concerned, unless it
    is the whole source.
    """

    kind: NoticeKind
    time: float
    text: str
    still: bool = False
    signal: str = ""


class Source(Protocol):
    """A source of rows; it only reads."""

    @property
    def dated(self) -> bool:
        """Whether its times are s since 1970 in UTC."""

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""

    def take(self, seconds: float) -> list[Rows | Notice]:
        """Everything received, after waiting at most so many seconds; may be empty."""

    def close(self) -> None:
        """Disconnect."""
