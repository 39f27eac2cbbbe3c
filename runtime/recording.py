"""A recording: readings over time, in SI, with what is wrong with them."""

from __future__ import annotations

import csv
import gzip
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from runtime.plan import Array
from runtime.ruleset import Ruleset, SignalSpec, UnitSpec

_HEADER = re.compile(r"\s*(?P<name>[^\[\]]+?)\s*(\[(?P<unit>[^\[\]]*)\])?\s*")
_FACTOR = re.compile(r"([A-Za-z%][A-Za-z%]*\d?|1)(?:\*\*|\^)?(-?\d)?")


class RecordingRefused(Exception):
    """The file cannot be used as a recording; the message says why and what to do."""


@dataclass(frozen=True)
class Recording:
    """Readings of one plant.

    Attributes
    ----------
    time : shape (n,), s.
    values : per signal id an array, shape (n,), SI; NaN where there is no usable reading.
    segment : shape (n,); changes where one file ends and the next begins.
    missing : signals of the ruleset that the recording does not have.
    notes : what was found while reading, for the operator.
    """

    time: Array
    values: Mapping[str, Array]
    segment: np.ndarray
    missing: tuple[str, ...]
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.time)


def read_recording(path: Path, ruleset: Ruleset) -> Recording:
    """Read a CSV file (also .gz) or a folder of them.

    Columns are ``time [s]`` and ``<module>.<signal> [unit]``, or foreign names that the plant's
    column map knows. Raises `RecordingRefused` with a message for the operator.
    """
    files = _files(path)
    parts = [_read_file(file, ruleset) for file in files]
    notes = [note for _, _, part_notes in parts for note in part_notes]
    signals = sorted({name for _, values, _ in parts for name in values})
    time = np.concatenate([t for t, _, _ in parts])
    segment = np.concatenate([np.full(len(t), i) for i, (t, _, _) in enumerate(parts)])
    values = {
        name: np.concatenate([v.get(name, np.full(len(t), np.nan)) for t, v, _ in parts])
        for name in signals
    }
    used = {s for o in ruleset.observers for s in o.signals}
    missing = tuple(s.id for s in ruleset.signals if s.id in used and s.id not in values)
    if not any(s in values for s in used):
        raise RecordingRefused(
            f"{path}: no column belongs to this plant. Expected columns such as "
            f"'{_example(ruleset)}'; foreign names need a column map (columns.yaml)"
        )
    return Recording(time, values, segment, missing, tuple(dict.fromkeys(notes)))


def _example(ruleset: Ruleset) -> str:
    if ruleset.columns:
        return ruleset.columns[0].column
    return f"{ruleset.signals[0].id} [{ruleset.signals[0].unit}]"


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        files = sorted(f for f in path.iterdir() if f.name.endswith((".csv", ".csv.gz")))
        if not files:
            raise RecordingRefused(f"{path}: this folder holds no .csv or .csv.gz file")
        return files
    if not path.is_file():
        raise RecordingRefused(f"{path}: there is no such file")
    return [path]


def _read_file(path: Path, ruleset: Ruleset) -> tuple[Array, dict[str, Array], list[str]]:
    rows = _rows(path)
    try:
        header = next(rows)
    except StopIteration:
        raise RecordingRefused(f"{path}: the file is empty") from None
    columns, time_index, notes = _assign(path, header, ruleset)
    wanted = [time_index, *(index for index, _, _ in columns.values())]
    cells: list[list[str]] = [[] for _ in wanted]
    width, short = len(header), 0
    for row in rows:
        if len(row) != width:
            short += 1
            if len(row) < max(wanted) + 1:
                continue
        for store, index in zip(cells, wanted, strict=True):
            store.append(row[index])
    if short:
        notes.append(f"{path.name}: {short} rows have another number of cells than the header")
    if not cells[0]:
        raise RecordingRefused(f"{path}: the file has a header but no rows")
    time = _times(path, cells[0])
    values = {}
    for store, (signal, (_, factor, offset)) in zip(cells[1:], columns.items(), strict=True):
        numbers, bad = _numbers(store)
        if bad:
            notes.append(f"{path.name}: {bad} cells of {signal} are not numbers, e.g. not judged")
        values[signal] = numbers * factor + offset
    return *_in_order(path, time, values, notes), notes


def _rows(path: Path) -> Iterator[list[str]]:
    """Rows of a CSV file, whatever its separator and decimal sign."""
    try:
        raw = path.read_bytes()
        if raw[:2] == b"\x1f\x8b":
            raw = gzip.decompress(raw)
        text = raw.decode("utf-8-sig")
    except (OSError, EOFError) as error:
        raise RecordingRefused(f"{path}: cannot be read ({error})") from None
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    if "\0" in text:
        raise RecordingRefused(f"{path}: this is a binary file, not CSV")
    first = text.split("\n", 1)[0]
    separator = max((";", "\t", ","), key=first.count)
    decimal_comma = separator != "," and "," in text.split("\n", 2)[-1][:2000]
    csv.field_size_limit(1_000_000)
    try:
        for row in csv.reader(io.StringIO(text), delimiter=separator):
            if row:
                yield [c.replace(",", ".") for c in row] if decimal_comma else row
    except csv.Error as error:
        raise RecordingRefused(f"{path}: not a readable CSV file ({error})") from None


def _assign(
    path: Path, header: Sequence[str], ruleset: Ruleset
) -> tuple[dict[str, tuple[int, float, float]], int, list[str]]:
    """Which column is which signal: (index, factor, offset) to SI."""
    foreign = {c.column.strip(): c for c in ruleset.columns}
    signals = ruleset.signal_by_id
    columns: dict[str, tuple[int, float, float]] = {}
    time_index, notes, seen = None, [], set()
    for index, title in enumerate(header):
        title = title.strip()
        if title in seen and title:
            raise RecordingRefused(f"{path}: the column '{title}' stands twice")
        seen.add(title)
        match = _HEADER.fullmatch(title)
        name = match["name"] if match else title
        if title == ruleset.time_column or (time_index is None and name.lower() in _TIMES):
            time_index = index
        elif title in foreign:
            column = foreign[title]
            columns[column.signal] = (index, column.factor, column.offset)
        elif name in signals:
            unit = (match and match["unit"]) or ""
            columns[name] = (index, *_conversion(path, title, unit, signals[name], ruleset, notes))
    if time_index is None:
        raise RecordingRefused(f"{path}: there is no time column; expected 'time [s]'")
    return columns, time_index, notes


_TIMES = ("time", "datetime", "timestamp", "t", "zeit")


def _conversion(
    path: Path,
    title: str,
    unit: str,
    signal: SignalSpec,
    ruleset: Ruleset,
    notes: list[str],
) -> tuple[float, float]:
    """Factor and offset of a column's unit."""
    if not unit:
        notes.append(f"{path.name}: '{title}' names no unit; {signal.unit} is assumed")
        return signal.factor, signal.offset
    if unit == signal.unit:
        return signal.factor, signal.offset
    found = _parse_unit(unit, ruleset.units)
    wanted = _parse_unit(signal.unit, ruleset.units)
    if found is None:
        raise RecordingRefused(f"{path}: column '{title}': unknown unit '{unit}'")
    if wanted is not None and found.dimension != wanted.dimension:
        raise RecordingRefused(
            f"{path}: column '{title}' is in {unit}, but {signal.id} is measured in {signal.unit}; "
            "are two columns swapped?"
        )
    return found.factor, found.offset


def _parse_unit(text: str, units: Mapping[str, UnitSpec]) -> UnitSpec | None:
    """Look a unit up; products and quotients are put together."""
    if text in units:
        return units[text]
    factor, dimension = 1.0, np.zeros(4)
    for i, group in enumerate(text.replace("(", "").replace(")", "").split("/")):
        for part in group.replace("**", "^").split("*"):
            match = _FACTOR.fullmatch(part.strip())
            unit = units.get(match[1]) if match else None
            if match is None or unit is None or unit.offset:
                return None
            power = int(match[2] or 1) * (1 if i == 0 else -1)
            factor *= unit.factor**power
            dimension = dimension + power * np.array(unit.dimension)
    return UnitSpec(float(factor), 0.0, tuple(float(d) for d in dimension))


def _numbers(cells: Sequence[str]) -> tuple[Array, int]:
    """Cells as numbers; words and empty cells become NaN. Second: how many words there were."""
    try:
        return np.array(cells, dtype=float), 0
    except ValueError:
        pass
    result, bad = np.full(len(cells), np.nan), 0
    for i, cell in enumerate(cells):
        try:
            result[i] = float(cell)
        except ValueError:
            bad += cell.strip().lower() not in ("", "nan", "na", "null", "none")
    return result, bad


def _times(path: Path, cells: Sequence[str]) -> Array:
    """Seconds; dates count from the first one."""
    numbers, bad = _numbers(cells)
    if bad == 0:
        return numbers
    try:
        stamps = [datetime.fromisoformat(c.strip()).timestamp() for c in cells]
    except ValueError:
        raise RecordingRefused(
            f"{path}: the time column holds '{cells[0][:30]}'; expected seconds or ISO dates"
        ) from None
    return np.array(stamps) - stamps[0]


def _in_order(
    path: Path, time: Array, values: dict[str, Array], notes: list[str]
) -> tuple[Array, dict[str, Array]]:
    """Drop samples without a time, sort by time, keep the first of equal times."""
    kept = np.isfinite(time)
    if not kept.any():
        raise RecordingRefused(f"{path}: no row has a time")
    order = np.flatnonzero(kept)[np.argsort(time[kept], kind="stable")]
    sorted_time = time[order]
    first = np.concatenate([[True], np.diff(sorted_time) > 0])
    if len(order) < len(time) or not first.all() or np.any(np.diff(order) < 0):
        dropped = len(time) - int(first.sum())
        notes.append(f"{path.name}: rows put in order of time, {dropped} without own time dropped")
    order = order[first]
    return time[order], {name: v[order] for name, v in values.items()}
