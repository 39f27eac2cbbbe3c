"""One time of several columns: a date, a time of day, and perhaps milliseconds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.counted_times import SPREADSHEET, counting_of, dated
from rulec_runtime.recordings.dates import dates_of, time_of_day
from rulec_runtime.recordings.table import Cells, Dates, texts_of
from rulec_runtime.recordings.time_column import order_in, plain_times


def time_of_parts(
    path: Path, parts: Sequence[Cells], form: FileForm, remarks: tuple[str, ...] = ()
) -> tuple[Cells, tuple[str, ...]]:
    """A column of times from its parts, with what is told of it: numbers, or dates. Raises
    `RecordingRefused` as `order_in` does."""
    told = list(remarks)
    first = comparable(path, parts[0], form, told)
    if len(parts) < 2 or not isinstance(first, Dates):
        return first, tuple(told)
    clock = _seconds_of_day(texts_of(parts[1]))
    midnights = first.seconds[np.isfinite(first.seconds)] % SPREADSHEET.factor == 0
    if not np.isfinite(clock).any() or not midnights.all():
        return first, tuple(told)  # the date holds the time of day
    seconds = first.seconds + clock
    if len(parts) > 2:
        seconds = seconds + np.nan_to_num(plain_times(texts_of(parts[2]))) / 1000
    told.append(f"the time is made of {len(parts)} columns")
    return Dates(seconds, first.zones), tuple(told)


def comparable(path: Path, times: Cells, form: FileForm, told: list[str]) -> Cells:
    """Times as numbers or dates; what was found about them is added to what is `told`."""
    if isinstance(times, Dates):
        return times
    numbers = times if isinstance(times, np.ndarray) else plain_times(times)
    if np.isfinite(numbers).any():
        counting = counting_of(path, numbers, "time", 0.0, form, told)
        return numbers if counting is None else dated(numbers, counting)
    texts = texts_of(times)
    return Dates(*dates_of(texts, order_in(path, lambda: texts, form, told)))


def seconds_in(times: Cells, form: FileForm) -> Array:
    """Numbers of times that were made comparable, s."""
    if isinstance(times, Dates):
        return times.seconds
    return np.asarray(times, dtype=float) * (form.time_factor or 1.0)


def _seconds_of_day(cells: Sequence[str]) -> Array:
    """Seconds since midnight; of a spreadsheet they may be a share of a day."""
    numbers = plain_times(cells)
    if np.isfinite(numbers).any():
        return numbers * SPREADSHEET.factor if np.nanmax(numbers) < 1 else numbers
    known = {cell: time_of_day(cell) for cell in {*cells}}
    return np.array([known[cell] for cell in cells])
