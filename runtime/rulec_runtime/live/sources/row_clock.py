"""Times of rows: strictly increasing, whatever the clock of the source does."""

import time as clocks
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits as readings
from rulec_runtime.contract.plan import Array
from rulec_runtime.live.rows import Notice
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.remarks import Remarks
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.plant_calendar import Calendar, moment


class RowClock:
    """Keeps the rows that are later than all before.

    One stamp far in the future would make all later rows late. So a clock without dates restarts
    after some late rows, and dates may be at most a day ahead of this computer's clock.

    `last` is the time of the last row handed out, s; `step` the last step from row to row, s;
    `shift` the offset added to times without dates, s; `dated` whether times are dates, None if
    unknown; `begins` whether a new file begins, with which a clock without dates may restart;
    `late` the number of rows since that are not later. Dates are shown by the clocks of `place`, a
    time zone.
    """

    def __init__(self, name: str, remarks: Remarks, place: str = "") -> None:
        self.last = -float("inf")
        self.step = 1.0
        self.shift = 0.0
        self.dated: bool | None = None
        self.begins = False
        self.late = 0
        self._name, self._remarks, self._place = name, remarks, place

    @property
    def now(self) -> float:
        """Time of a notice, as of rows; before the first row that of this computer, or 0."""
        return self.last if self.begun else clocks.time() if self.dated else 0.0

    @property
    def shown(self) -> str:
        """Time of the last row, for people."""
        return self._shown(self.last)

    @property
    def begun(self) -> bool:
        """Whether there was a row."""
        return self.last > -float("inf")

    def later(self, time: Array) -> tuple[Array, NDArray[np.bool_], list[Notice]]:
        """Times to hand out, shape (n,), s; flags of the rows to keep; notices about the others.

        A clock without dates that restarts with a new file continues where the last one ended, as
        in the diagnosis of a folder of files.
        """
        usable = np.isfinite(time) & (np.abs(time) < readings.ABSURD)
        if self.dated:
            usable &= time < clocks.time() + limits.FUTURE
        found: list[Notice] = []
        if (self.begins or self.late >= limits.SET_BACK) and usable.any():
            found += self._begin_anew(float(time[usable][0]))
        time = time + self.shift
        checked = np.where(usable, time, -np.inf)
        before = np.maximum.accumulate(np.concatenate([[self.last], checked]))
        newer = usable & (checked > before[:-1])
        last = int(np.flatnonzero(newer)[-1]) if newer.any() else -1
        self.late = int(usable[last + 1 :].sum()) + (0 if newer.any() else self.late)
        if newer.any():
            times = time[newer]
            steps = np.diff(times)
            if len(steps):
                self.step = float(np.median(steps))
            elif self.begun:
                self.step = float(times[0] - self.last)
            self.last = float(times[-1])
        if not usable.all():
            found += self._tell(int((~usable).sum()), ("has", "have"), "no usable time", "unusable")
        if len(late := np.flatnonzero(usable & ~newer)):
            shown = self._shown(before[late[0]])
            many = f"those before them (the first: not later than {shown})"
            text = f"not later than {many if len(late) > 1 else shown}"
            found += self._tell(len(late), ("is", "are"), text, "late")
        return time, newer, found

    def _begin_anew(self, first: float) -> list[Notice]:
        """If all new times are before `last`, the clock was set back, or `last` was wrong: continue
        from there."""
        self.begins, self.late = False, 0
        if self.dated or first + self.shift > self.last:
            return []
        self.shift = self.last + self.step - first
        text = f"{self._name}: its clock began anew; {self.shift:.10g} s are added to its times"
        return self._remarks.tell("clock", "anew", self.last, text)

    def _shown(self, time: float) -> str:
        with suppress(ValueError, OverflowError, OSError):  # beyond the calendar
            return moment(Calendar(0.0, place=self._place) if self.dated else None, float(time))
        return moment(None, float(time))

    def _tell(self, rows: int, verb: tuple[str, str], what: str, key: str) -> list[Notice]:
        one, many = (f"row {verb[0]} {what} and is", f"rows {verb[1]} {what} and are")
        text = f"{self._name}: {plural(rows, one, many)} left out"
        return self._remarks.tell("clock", key, self.now, text)
