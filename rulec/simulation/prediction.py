"""The prediction of a model for a recording, and as a file."""

import csv
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan
from typing import TextIO

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.csv_cell import as_meant, defused, row_of
from rulec_runtime.recordings.formats import opened_sheet
from rulec_runtime.recordings.recording_file import RecordingFile, form_of
from rulec_runtime.recordings.titles import parts_of

from rulec.simulation.equations import SimulationRefused


@dataclass(frozen=True)
class Injected:
    """A fault that acts from one time of the recording to another, s."""

    fault: str
    degree: float
    since: float = -np.inf
    until: float = np.inf


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """The prediction for a recording of n rows; before `sense`, with perfect sensors.

    Attributes
    ----------
    given : signals taken from the recording.
    values : an array per predicted signal, shape (n,), SI; NaN where it is not predicted.
    whole : shape (n,), rows in which everything is predicted.
    notes : remarks for the user.
    gains : factors, shape (n,), by which faults in sensors scale predictions and their errors.
    limited : signals limited to the ranges of their sensors.
    """

    given: tuple[str, ...]
    values: Mapping[str, Array]
    whole: np.ndarray
    notes: tuple[str, ...]
    gains: Mapping[str, Array] = field(default_factory=dict)
    limited: tuple[str, ...] = ()


def recorded_of(
    ruleset: Ruleset, files: Sequence[RecordingFile], names: Iterable[str]
) -> dict[str, Array]:
    """Readings as recorded, shape (n,); raises `SimulationRefused` if a file lacks a column."""
    wanted = list(names)
    for file in files:
        missing = [name for name in wanted if name not in file.values]
        if missing:
            titles = [f"'{column_of(name, ruleset)[0]}'" for name in missing]
            what = "columns" if len(titles) > 1 else "column"
            raise SimulationRefused(
                f"{file.path}: to predict the other readings of {ruleset.plant}, it "
                f"needs the {what} {', '.join(titles)}"
            )
    return {n: np.concatenate([file.values[n] for file in files]) for n in wanted}


def clipped_to_range(
    ruleset: Ruleset, values: Mapping[str, Array], names: Iterable[str]
) -> dict[str, Array]:
    """Readings, those of the signals in `names` limited to the ranges of their sensors."""
    result = dict(values)
    for name in names:
        result[name] = np.clip(result[name], *ruleset.signal_by_id[name].ends)
    return result


def beyond_ends(signal: SignalSpec, values: Array) -> Iterator[tuple[np.ndarray, str, float]]:
    """Where readings leave the range of their sensor: flags, side, and end of the range, SI."""
    low, high = signal.ends
    for beyond, word, end in ((values < low, "below", low), (values > high, "above", high)):
        if beyond.any():
            yield beyond, word, end


def rows(flags: np.ndarray) -> str:
    """The number of flagged rows and the first of them, in words."""
    count, first = int(flags.sum()), int(np.argmax(flags)) + 1
    if count == len(flags):
        return f"all {count} rows"
    return f"{count} of {len(flags)} rows (the first is data row {first})"


DIGITS = 10
"""Significant digits of a number: more than any sensor has, fewer than rounding affects."""


def rewrite(
    file: RecordingFile, ruleset: Ruleset, values: Mapping[str, Array], target: TextIO
) -> None:
    """Write a file's rows with the readings of some signals; NaN becomes an empty cell.

    `values` holds an array per signal, shape (rows of the file,), SI. A signal without a column
    gets one after the others, under its foreign name if the plant knows one. So does a difference
    of columns, which stay as recorded.
    """
    with opened_sheet(file.path, form_of(ruleset)) as sheet:
        writer = csv.writer(target, delimiter=sheet.separator, lineterminator="\n")
        header = [with_unit(t, u) for t, u in zip(sheet.titles, sheet.units, strict=True)]
        replaced: dict[int, Iterable[str]] = {}
        columns_of = Counter(column.signal for column in file.header.targets)
        for column in file.header.targets:
            is_one = columns_of[column.signal] == 1
            if column.signal in values and is_one and column.index not in replaced:
                shown = (values[column.signal] - column.offset) / column.factor
                replaced[column.index] = cells(shown, file.comma)
        added = [name for name in values if columns_of[name] != 1]
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
    """Title of a signal's column, its own if it has several; SI = number * factor + offset."""
    mapped = [column for column in ruleset.columns if column.signal == name]
    if len(mapped) == 1:
        return mapped[0].column, mapped[0].factor, mapped[0].offset
    signal = ruleset.signal_by_id[name]
    return f"{name} [{signal.unit}]", signal.factor, signal.offset


def cells(values: Array, comma: bool = False) -> list[str]:
    """Numbers as text for a file."""
    shown = ["" if isnan(v) else f"{v:.{DIGITS}g}" for v in values.tolist()]
    return [cell.replace(".", ",") for cell in shown] if comma else shown
