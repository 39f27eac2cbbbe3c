"""Treat readings in memory, by the titles that a file would have, like a file of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.csv_table import Column, RecordingRefused, read_cells
from rulec_runtime.recordings.header import Header, assign
from rulec_runtime.recordings.recording_file import RecordingFile, readings_of
from rulec_runtime.recordings.table import Dates
from rulec_runtime.recordings.time_column import factor_of_time, read_times

Cells = np.ndarray | list[str]
"""A column: numbers, dates (datetime64, in UTC), durations (timedelta64), or words."""


def file_of(
    name: str, columns: Mapping[str, Cells], ruleset: Ruleset, notes: list[str], zoned: bool = False
) -> RecordingFile:
    """Columns of equal length as the file that would hold them.

    Parameters
    ----------
    name : its name in messages.
    columns : per title, such as ``A.dp [bar]``, its cells, shape (n,).
    zoned : whether dates are known to be in UTC; else they name no zone.

    Raises
    ------
    RecordingRefused
        There is no time column or no row, or lengths differ.
    """
    path, titles = Path(name), list(columns)
    lengths = {title: len(cells) for title, cells in columns.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"'{title}' {n}" for title, n in list(lengths.items())[:4])
        raise RecordingRefused(f"{name}: columns have different numbers of rows: {shown}")
    header = assign(path, titles, ruleset, notes)
    if not any(lengths.values()):
        raise RecordingRefused(f"{name}: there are no rows")
    time, zones = _times(path, columns[titles[header.time]], header, ruleset, zoned, notes)
    read = [_column(name, titles[t.index], columns[titles[t.index]]) for t in header.targets]
    return RecordingFile(
        path=path,
        header=header,
        time=time,
        values=readings_of(path, read, header, ruleset, notes),
        zones=zones,
        comma=False,
    )


def _times(
    path: Path, cells: Cells, header: Header, ruleset: Ruleset, zoned: bool, notes: list[str]
) -> tuple[Array, Array | None]:
    title, unit, zone = header.time_title, header.time_unit, ruleset.time_zone
    if isinstance(cells, list):
        return read_times(path, cells, title, unit, ruleset.units, zone, notes)
    if cells.dtype.kind == "M":
        since = _seconds(cells - np.datetime64(0, "s"))
        dates = Dates(since, np.full(len(cells), 0.0 if zoned else np.nan))
        return read_times(path, dates, title, unit, ruleset.units, zone, notes)
    if cells.dtype.kind == "m":
        return _seconds(cells), None
    factor = factor_of_time(path, header.time_title, header.time_unit, ruleset.units)
    return cells.astype(float) * factor, None


def _seconds(lengths: np.ndarray) -> Array:
    """Durations in s, NaN where missing."""
    return np.asarray(lengths / np.timedelta64(1, "s"), dtype=float)


def _column(name: str, title: str, cells: Cells) -> Column:
    column = Column(title)
    if isinstance(cells, list):
        read_cells(column, cells, 0, comma=True)
    elif cells.dtype.kind in "Mm":
        raise RecordingRefused(f"{name}: column '{title}' holds dates or times, not readings")
    else:
        column.parts.append(cells.astype(float))
    return column


def different(given: Sequence[object]) -> None:
    """Refuse readings in memory that are given twice: their evidence would count twice."""
    if len({id(one) for one in given}) < len(given):
        raise RecordingRefused(
            "the same readings are given twice; what they show would count twice. Give each "
            "recording once"
        )
