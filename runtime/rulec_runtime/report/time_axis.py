"""Axes of time: dates if the recording has them, else seconds, minutes or hours."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.plant_calendar import DAY, HOUR, MINUTE, Calendar
from rulec_runtime.report.chart import Axis, axis

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


def time_axis(low: float, high: float, calendar: Calendar | None) -> Axis:
    """An axis over times, s, that ends with the data.

    >>> time_axis(0.0, 7200.0, Calendar(1731628800.0)).labels()
    ['00:00', '00:30', '01:00', '01:30', '02:00']
    >>> time_axis(0.0, 3600.0, None).labels(), time_axis(0.0, 3600.0, None).title
    (['0', '10', '20', '30', '40', '50', '60'], 'time [min]')
    """
    if not high > low:
        low, high = low - 1.0, high + 1.0
    if calendar is not None:
        step = min(STEPS[::-1], key=lambda s: abs((high - low) / s - WANTED_DATES))
        ticks = tuple(_round_dates(low, high, calendar, step))
        if len(ticks) > 1:
            return _dated(Axis(low, high, ticks), calendar, step)
    unit, name = next((unit, name) for least, unit, name in UNITS if high - low >= least)
    made = axis(low / unit, high / unit, WANTED, tight=True)
    ticks = tuple(tick * unit for tick in made.ticks)
    return Axis(low, high, ticks, tuple(made.labels()), title=f"time [{name}]")


def over(time: Array, calendar: Calendar | None) -> Axis:
    """An axis over times, s, shape (n,), in any order."""
    return time_axis(float(np.min(time)), float(np.max(time)), calendar)


def _dated(bare: Axis, calendar: Calendar, step: float) -> Axis:
    """An axis labelled by the clock of the plant, with the date below where it changes."""
    dates = [calendar.at(round(tick, 3)) for tick in bare.ticks]
    days = [f"{date:%Y-%m-%d}" for date in dates]
    form = "%H:%M" if step >= MINUTE else "%H:%M:%S"
    texts = days if step >= DAY else [format(date, form) for date in dates]
    changes = [day if day != last else "" for last, day in zip(["", *days], days, strict=False)]
    below = () if step >= DAY else tuple(changes)
    title = f"time ({calendar.zone()})" if calendar.offsets else "time"
    return replace(bare, texts=tuple(texts), below=below, title=title)


def _round_dates(low: float, high: float, calendar: Calendar, step: float) -> Iterator[float]:
    """Multiples of a step on the local clock, whose offset from UTC may change."""

    def ahead(time: float) -> float:
        offset = calendar.at(time).utcoffset()
        return 0.0 if offset is None else offset.total_seconds()

    first = np.ceil((calendar.start + low + ahead(low) - 1e-6) / step)
    for i in range(int(2 * (high - low) / step) + 4):
        local = float((first + i) * step) - calendar.start
        tick = local - ahead(local - ahead(low))
        if tick > high:
            return
        if tick >= low - 1e-6:
            yield tick
