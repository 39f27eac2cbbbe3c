"""All that an operator may look at at one moment, and how old it is."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.recordings.wall_clock import Calendar


@dataclass(frozen=True, kw_only=True)
class Now:
    """The plant as it is told now.

    Attributes
    ----------
    time : s, of the last row; None before any. `calendar` says what that is on the clock.
    status : letter of NE 107 of all that is active, or ``ok``.
    source, connected, remark : where rows come from, whether they do, and what was last said of it.
    rows : how many have come.
    active : episodes that have not ended, the worst first.
    past : the latest events, newest first.
    acknowledged : ids of episodes that somebody has taken note of.
    diagnosis : what the rows say that are remembered; None before anything could be judged.
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
        """Was anything? Else that nothing was found says nothing."""
        return self.diagnosis is not None and self.diagnosis.judged > 0


class Arrival:
    """When the count of rows last rose, by the clock of whoever looks: those of plants go wrong."""

    def __init__(self) -> None:
        self._rows = 0
        self._since: float | None = None

    def saw(self, rows: int, time: float) -> None:
        """So many rows had come at a time, s, of a clock that only runs forward."""
        if rows != self._rows:
            self._rows, self._since = rows, time

    def age(self, time: float) -> float | None:
        """How long ago the last row came, s; None before any."""
        return None if self._since is None else max(time - self._since, 0.0)
