"""Axes of time: dates if the recording has them, else seconds, minutes or hours."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.plant_calendar import DAY, HOUR, MINUTE, Calendar
from rulec_runtime.report.chart import Axis, axis
from rulec_runtime.report.figure import plot

WANTED, WANTED_DATES = 9, 6
"""Ticks of an axis; a date takes more room than a number."""

UNITS = ((20 * HOUR, HOUR, "h"), (20 * MINUTE, MINUTE, "min"), (0.0, 1.0, "s"))
"""Shortest length of an axis, s, for each unit, with its size, s, and name."""

STEPS = (
    *(1.0, 2.0, 5.0, 10.0, 15.0, 30.0),
    *(m * MINUTE for m in (1, 2, 5, 10, 15, 30)),
    *(h * HOUR for h in (1, 2, 3, 6, 12)),
    *(d * DAY for d in (1, 2, 7, 14, 28, 91, 182, 364, 728)),
)
"""Distances of dates, s."""


@dataclass(frozen=True)
class Scaled(Axis):
    """Times in s, labelled in another unit."""

    unit: float

    def labels(self) -> list[str]:
        ticks = tuple(tick / self.unit for tick in self.ticks)
        return Axis(self.low / self.unit, self.high / self.unit, ticks).labels()


@dataclass(frozen=True)
class Dated(Axis):
    """Times in s, labelled by the clock of the plant, with the date below where it changes."""

    calendar: Calendar
    form: str

    def labels(self) -> list[str]:
        return self._texts(self.form)

    def second_lines(self) -> list[str]:
        if self.form.startswith("%Y"):
            return []
        days = self._texts("%Y-%m-%d")
        return [
            day if day != before else "" for before, day in zip(["", *days], days, strict=False)
        ]

    def _texts(self, form: str) -> list[str]:
        return [format(self.calendar.at(round(tick, 3)), form) for tick in self.ticks]


def time_axis(low: float, high: float, calendar: Calendar | None) -> Axis:
    """An axis over times, s, that ends with the data.

    >>> time_axis(0.0, 7200.0, Calendar(1731628800.0)).labels()
    ['00:00', '00:30', '01:00', '01:30', '02:00']
    >>> time_axis(0.0, 3600.0, None).labels()
    ['0', '10', '20', '30', '40', '50', '60']
    """
    if not high > low:
        low, high = low - 1.0, high + 1.0
    dated = None if calendar is None else _dated(low, high, calendar)
    if dated is not None:
        return dated
    unit = _unit(low, high)[0]
    made = axis(low / unit, high / unit, WANTED, tight=True)
    return Scaled(low, high, tuple(tick * unit for tick in made.ticks), unit)


def over(time: Array, calendar: Calendar | None) -> Axis:
    """An axis over times, s, shape (n,), in any order."""
    return time_axis(float(np.min(time)), float(np.max(time)), calendar)


def named(shown: Axis, calendar: Calendar | None) -> str:
    """Title of an axis of time.

    >>> named(time_axis(0.0, 3600.0, None), None)
    'time [min]'
    """
    if isinstance(shown, Dated) and calendar is not None:
        return f"time ({calendar.zone()})" if calendar.offsets else "time"
    return f"time [{_unit(shown.low, shown.high)[1]}]"


def time_plot(svg: str, foot: bool, across: Axis, calendar: Calendar | None) -> str:
    """A panel over time with room for its axes."""
    return plot(svg, foot, named(across, calendar), bool(across.second_lines()))


def _unit(low: float, high: float) -> tuple[float, str]:
    return next((unit, name) for least, unit, name in UNITS if high - low >= least)


def _dated(low: float, high: float, calendar: Calendar) -> Dated | None:
    """Ticks at round times of the plant's clock; None if fewer than two fit."""
    step = min(STEPS[::-1], key=lambda s: abs((high - low) / s - WANTED_DATES))
    ticks = tuple(_rounds(low, high, calendar, step))
    form = "%Y-%m-%d" if step >= DAY else "%H:%M" if step >= MINUTE else "%H:%M:%S"
    return Dated(low, high, ticks, calendar, form) if len(ticks) > 1 else None


def _rounds(low: float, high: float, calendar: Calendar, step: float) -> Iterator[float]:
    """Multiples of a step on the local clock, whose offset from UTC may change."""
    local = calendar.start + low + _offset(low, calendar)
    first = np.ceil((local - 1e-6) / step)
    for i in range(int(2 * (high - low) / step) + 4):
        tick = _time(float((first + i) * step), low, calendar)
        if tick > high:
            return
        if tick >= low - 1e-6:
            yield tick


def _time(local: float, near: float, calendar: Calendar) -> float:
    """The time, s, at which the plant's clock shows `local`, s since 1970."""
    time = local - calendar.start - _offset(near, calendar)
    return local - calendar.start - _offset(time, calendar)


def _offset(time: float, calendar: Calendar) -> float:
    ahead = calendar.at(time).utcoffset()
    return 0.0 if ahead is None else ahead.total_seconds()
