"""Fill readings that are written only on change: each holds until the next of its signal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import Column
from rulec_runtime.recordings.larger_than_memory import Growing
from rulec_runtime.recordings.table import Cells
from rulec_runtime.recordings.time_column import seconds_in


def last_before(own: Array, rows: Array, longest: float | None) -> NDArray[np.intp]:
    """Index of the latest of the times `own` at or before each of the times `rows`, both in order,
    s; -1 if there is none, or if it is older than `longest`."""
    at = np.searchsorted(own, rows, side="right") - 1
    if longest is not None and len(own):
        at[rows - own[np.maximum(at, 0)] > longest] = -1
    return np.asarray(at, dtype=np.intp)


def held(
    columns: Mapping[int, Column], time: Cells, form: FileForm, remarks: tuple[str, ...]
) -> tuple[dict[int, Column], tuple[str, ...]]:
    """Columns whose empty cells take the reading above them while it holds; a word ends it."""
    seconds, found = seconds_in(time, form), {}
    for index, column in columns.items():
        values = column.numbers()
        rows = rows_written(values, column, seconds)
        if len(rows):
            at = last_before(seconds[rows], seconds, form.hold_for)
            values = np.where(at >= 0, values[rows[np.maximum(at, 0)]], np.nan)
        found[index] = replace(column, parts=Growing())
        found[index].parts.append(values)
    return found, (*remarks, remark_on_hold(form))


def remark_on_hold(form: FileForm) -> str:
    """The remark on readings that hold."""
    most = "" if form.hold_for is None else f", for {form.hold_for:g} s at most"
    return f"a reading holds until the next one of its signal{most}, as the column map says"


def rows_written(values: Array, column: Column, seconds: Array) -> NDArray[np.intp]:
    """Rows of a column with a number or a word, in order of time."""
    there = np.isfinite(values)
    there[[*(column.placed or ())]] = True
    rows = np.flatnonzero(there & np.isfinite(seconds))
    return rows[np.argsort(seconds[rows], kind="stable")]


def written_on_change(times: Array, rows: int) -> bool:
    """Whether times, in order, s, belong to a reading written on change: few compared with `rows`,
    and at irregular intervals."""
    if len(times) > limits.SHARE_ON_CHANGE * rows:
        return False
    steps = np.diff(times)
    if len(steps) < 2:
        return rows > limits.ROWS_ON_CHANGE
    usual = np.abs(steps - np.median(steps)) <= 0.5 * np.median(steps)
    return float(usual.mean()) < limits.SHARE_REGULAR
