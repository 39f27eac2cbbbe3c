"""Read one file: which column is which signal, and its numbers in the order of its rows.

Readings in memory, by the titles that a file would have, are treated like a file of them.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.nearest import near_file
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.arrays import array_sheet, seconds_of
from rulec_runtime.recordings.csv_table import Column, RecordingRefused
from rulec_runtime.recordings.formats import (
    CSV,
    STANDARD_INPUT,
    file_and_table,
    is_called_recording,
    opened_sheet,
)
from rulec_runtime.recordings.header import Header, Target, assign, foreign, summed
from rulec_runtime.recordings.larger_than_memory import copied
from rulec_runtime.recordings.table import Dates, Table
from rulec_runtime.recordings.time_column import read_times
from rulec_runtime.recordings.titles import names_of_times

SHOWN = 5


@dataclass(frozen=True, kw_only=True)
class RecordingFile:
    """Readings in the order of a file.

    Attributes
    ----------
    header : which column is which signal, and which belongs to none.
    time : shape (n,), s; NaN where a row has none. Since 1970 if the file is `dated`.
    zones : shape (n,), s ahead of UTC, NaN where a date names no zone; None without dates.
    values : per signal an array, shape (n,), SI; NaN where there is no usable reading.
    comma : whether its numbers have a decimal comma.
    left_out : number of rows with a wrong number of cells.
    """

    path: Path
    header: Header
    time: Array
    values: dict[str, Array]
    zones: Array | None
    comma: bool
    left_out: int = 0

    @property
    def dated(self) -> bool:
        """Whether its times are dates."""
        return self.zones is not None


def files_of(path: Path) -> list[Path]:
    """The file, or all recordings of a folder sorted by name: its CSV files, or if it has none,
    those of other formats. A table named after a folder applies to each file."""
    file, table = file_and_table(path)
    if file == STANDARD_INPUT:
        return [path]
    if not file.is_dir():
        if not file.exists():
            near = near_file(file)
            hint = f"; did you mean '{near}'?" if near else ""
            raise RecordingRefused(f"{path}: there is no such file{hint}")
        return [path]
    files = sorted(f for f in file.iterdir() if is_called_recording(f))
    csv = [f for f in files if f.name.lower().endswith(CSV.suffixes)]
    if not files:
        raise RecordingRefused(
            f"{path}: this folder holds no .csv or .csv.gz file, nor a recording of another format"
        )
    return [f.with_name(f"{f.name}#{table}") if table else f for f in csv or files]


def form_of(ruleset: Ruleset) -> FileForm:
    """The form of recordings, as far as the plant's column map describes it."""
    form = ruleset.file
    return form if form.time else replace(form, time=tuple(filter(None, (ruleset.time_column,))))


def times_of(ruleset: Ruleset) -> frozenset[str]:
    """Names of time columns, in lower case except the plant's own."""
    return names_of_times(form_of(ruleset))


def read_file(path: Path, ruleset: Ruleset, notes: list[str]) -> RecordingFile:
    """Read all columns that belong to signals; remarks on them go to `notes`."""
    form = form_of(ruleset)
    with opened_sheet(path, form) as sheet:
        header = assign(path, sheet.titles, ruleset, notes, sheet.units)
        table = sheet.read([header.time], [target.index for target in header.targets])
    notes += (f"{path.name}: {remark}" for remark in (*sheet.remarks, *table.remarks))
    if table.left_out:
        other = "another number of cells than the header and"
        one, many = f"row has {other} is", f"rows have {other} are"
        notes.append(
            f"{path.name}: {plural(table.left_out, one, many)} left out (the first is data row "
            f"{table.first_left_out})"
        )
    return _file(path, header, table, header.time_unit, ruleset, notes)


def _file(
    path: Path, header: Header, table: Table, unit: str, ruleset: Ruleset, notes: list[str]
) -> RecordingFile:
    """Times, in a unit if they are numbers, and readings of a table."""
    title, zone, form = header.time_title, ruleset.time_zone, form_of(ruleset)
    try:
        time, zones = read_times(path, table.raw[0], title, unit, ruleset.units, zone, notes, form)
    except RecordingRefused:
        if header.targets:
            raise
        raise foreign(str(path), ruleset) from None  # a foreign file is not quoted
    parts = list[Array]()
    readers_of = Counter(target.index for target in header.targets)
    for column, target in zip(table.columns, header.targets, strict=True):
        shared = readers_of[target.index] > 1
        part, remarks = readings_of(column, target, ruleset, shared=shared)
        parts.append(part)
        notes += (f"{path.name}: {text}" for _, text in remarks)
    values = summed(header.targets, parts)
    for signal, readings in values.items():
        if not np.isfinite(readings).any():
            notes.append(f"{path.name}: {signal} has not one reading")
    return RecordingFile(
        path=path,
        header=header,
        time=time,
        values=values,
        zones=zones,
        comma=any("," in (column.written.decimal, *column.decimals) for column in table.columns),
        left_out=table.left_out,
    )


def largest_reading(signal: SignalSpec) -> float:
    """The largest possible reading, SI."""
    ends = (signal.reference, signal.full_scale, signal.lowest, signal.highest)
    finite = [abs(end) for end in ends if end is not None and isfinite(end)]
    scale = max(finite, default=0.0)
    return min(common.ABSURD, limits.BEYOND_SENSOR * scale) if scale else common.ABSURD


def readings_of(
    column: Column, target: Target, ruleset: Ruleset, placed: bool = True, shared: bool = False
) -> tuple[Array, list[tuple[str, str]]]:
    """The numbers of a column in SI, changed in place unless others read it too (`shared`), and
    remarks, each with what it is about.

    NaN where a cell is one of the `words`, `absurd` (beyond any sensor), or `missing` by the column
    map. Remarks name the first row if its number is that in a file (`placed`).
    """
    signal, missing = ruleset.signal_by_id[target.signal], ruleset.file.missing
    found = list[tuple[str, str]]()

    def note(about: str, count: int, one: str, many: str, more: str) -> None:
        cell, cells = f"cell of {signal.id} {one}", f"cells of {signal.id} {many}"
        found.append((about, f"{plural(count, cell, cells)}{more}"))

    if column.first is not None:
        (row, word), others = column.first, ""
        if len(column.states) > 1:
            counts = [f"'{w}' {times}" for w, times in column.states.most_common(SHOWN)]
            left = len(column.states) - SHOWN
            others = f"; {', '.join(counts)}" + (f" and {left} others" if left > 0 else "")
        place = f", in data row {row}" if placed else ""
        more = f" (the first{place}: '{word}'{others}); there it has no reading"
        note("words", column.words, "is a word", "are words", more)
    values = copied(column.numbers()) if shared else column.numbers()
    if missing and (absent := np.isin(values, missing)).any():
        shown = " or ".join(f"{number:g}" for number in missing)
        more = f" {shown}, which the column map calls missing"
        note("missing", int(absent.sum()), "is", "are", more)
        values[absent] = np.nan
    with np.errstate(over="ignore"):
        values[:] = values * target.factor + target.offset
    absurd = np.abs(values) > largest_reading(signal)
    if absurd.any():
        place = f" (the first in data row {int(np.argmax(absurd)) + 1})" if placed else ""
        more = f" beyond any sensor{place}; there it has no reading"
        note("absurd", int(absurd.sum()), "is", "are", more)
        values[absurd] = np.nan
    return values, found


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
    cells: list[Any] = list(columns.values())
    kinds = ["" if isinstance(one, list) else one.dtype.kind for one in cells]
    for index in (target.index for target in header.targets):
        if kinds[index] in ("M", "m"):
            text = f"column '{titles[index]}' holds dates or times, not readings"
            raise RecordingRefused(f"{name}: {text}")
    rows, kind = len(cells[header.time]), kinds[header.time]
    if kind == "M":
        zones = np.full(rows, 0.0 if zoned else np.nan)
        cells[header.time] = Dates(seconds_of(cells[header.time]), zones)
    sheet = array_sheet("", titles, (), rows, lambda at: [[cells[i] for i in at]])
    table = sheet.read([header.time], [target.index for target in header.targets])
    return _file(path, header, table, "s" if kind == "m" else header.time_unit, ruleset, notes)


def different(given: Sequence[object]) -> None:
    """Refuse readings in memory that are given twice: their evidence would count twice."""
    if len({id(one) for one in given}) < len(given):
        raise RecordingRefused(
            "the same readings are given twice; what they show would count twice. Give each "
            "recording once"
        )
