"""Everything an operator can see at one moment, and how old it is."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.recordings.plant_calendar import Calendar


@dataclass(frozen=True, kw_only=True)
class Now:
    """The present state of the plant.

    Attributes
    ----------
    time : of the last row, s; None before any. `calendar` converts it to a date.
    status : letter of NE 107 of all active episodes, or ``ok``.
    source, connected, remark : the source, whether rows come from it, and its last notice.
    rows : number of rows received.
    active : episodes that have not ended, the worst first.
    past : the latest events, newest first.
    acknowledged : ids of acknowledged episodes.
    diagnosis : of the rows in memory; None before anything could be judged.
    """

    plant: str
    title: str
    time: float | None
    calendar: Calendar | None
    status: str
    source: str
    connected: bool
    remark: str
    rows: int
    active: tuple[Episode, ...]
    past: tuple[Event, ...]
    acknowledged: frozenset[str]
    diagnosis: Diagnosis | None

    @property
    def judged(self) -> bool:
        """Whether anything was judged; otherwise the absence of findings means nothing."""
        return self.diagnosis is not None and self.diagnosis.judged > 0


class Arrival:
    """When the last row arrived, by the clock of the viewer: clocks of plants go wrong."""

    def __init__(self) -> None:
        self._rows = 0
        self._since: float | None = None

    def saw(self, rows: int, time: float) -> None:
        """Record the number of rows at a time, s, of a monotonic clock."""
        if rows != self._rows:
            self._rows, self._since = rows, time

    def age(self, time: float) -> float | None:
        """Seconds since the last row arrived; None before any."""
        return None if self._since is None else max(time - self._since, 0.0)
