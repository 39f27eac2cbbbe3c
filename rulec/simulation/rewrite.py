"""A recording in its original layout, with some columns replaced and others added."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from math import isnan
from typing import TextIO

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.csv_cell import as_meant, defused, row_of
from rulec_runtime.recordings.formats import opened_sheet
from rulec_runtime.recordings.header import parts_of
from rulec_runtime.recordings.recording_file import RecordingFile, form_of

DIGITS = 10
"""Significant digits of a number: more than any sensor has, fewer than rounding affects."""


def rewrite(
    file: RecordingFile, ruleset: Ruleset, values: Mapping[str, Array], target: TextIO
) -> None:
    """Write a file's rows with the readings of some signals; NaN becomes an empty cell.

    `values` holds an array per signal, shape (rows of the file,), SI. A signal without a column
    gets one after the others, under its foreign name if the plant knows one.
    """
    with opened_sheet(file.path, form_of(ruleset)) as sheet:
        writer = csv.writer(target, delimiter=sheet.separator, lineterminator="\n")
        header = [with_unit(t, u) for t, u in zip(sheet.titles, sheet.units, strict=True)]
        replaced: dict[int, Iterable[str]] = {}
        for place in file.header.targets:
            if place.signal in values and place.index not in replaced:
                shown = (values[place.signal] - place.offset) / place.factor
                replaced[place.index] = cells(shown, file.comma)
        there = {place.signal for place in file.header.targets}
        added = [name for name in values if name not in there]
        for name in added:
            title, factor, offset = column_of(name, ruleset)
            replaced[len(header)] = cells((values[name] - offset) / factor, file.comma)
            header.append(title)
        writer.writerow(defused(as_meant(title)) for title in header)
        columns = zip(*replaced.values(), strict=True) if replaced else None
        for row in sheet.lines():
            row += [""] * len(added)
            for index, cell in zip(replaced, next(columns) if columns else (), strict=True):
                row[index] = cell
            writer.writerow(defused(cell) for cell in row)


def with_unit(title: str, unit: str) -> str:
    """A title with the unit that the file states separately.

    >>> with_unit("A.dp", "bar"), with_unit("A.dp [bar]", "mbar")
    ('A.dp [bar]', 'A.dp [bar]')
    """
    return f"{title} [{unit}]" if unit and not parts_of(title.strip())[1] else title


def write_columns(columns: Mapping[str, Array], target: TextIO) -> None:
    """Write columns by title, each of shape (n,), as a file of their own; NaN is an empty cell."""
    target.write(f"{row_of(columns)}\n")
    for row in zip(*(cells(values) for values in columns.values()), strict=True):
        target.write(",".join(row) + "\n")


def column_of(name: str, ruleset: Ruleset) -> tuple[str, float, float]:
    """Title of a signal's column; SI = number * factor + offset."""
    for column in ruleset.columns:
        if column.signal == name:
            return column.column, column.factor, column.offset
    signal = ruleset.signal_by_id[name]
    return f"{name} [{signal.unit}]", signal.factor, signal.offset


def cells(values: Array, comma: bool = False) -> list[str]:
    """Numbers as text for a file."""
    shown = ["" if isnan(v) else f"{v:.{DIGITS}g}" for v in values.tolist()]
    return [cell.replace(".", ",") for cell in shown] if comma else shown
