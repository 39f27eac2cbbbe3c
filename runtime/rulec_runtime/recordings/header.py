"""Assign the columns of a recording to signals, with their units."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.csv_cell import as_meant
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.reading_unit import conversion, parse_unit
from rulec_runtime.recordings.titles import is_time, parts_of

SHOWN = 4
"""Most names shown of a list; the others are counted."""


@dataclass(frozen=True)
class Target:
    """A column that belongs to a signal: SI = number * factor + offset, or a summand of it."""

    index: int
    signal: str
    factor: float
    offset: float


@dataclass
class Header:
    """The columns of a file; `strangers` belong to no signal."""

    time: int = -1
    time_title: str = ""
    time_unit: str = ""
    targets: list[Target] = field(default_factory=list)
    strangers: list[str] = field(default_factory=list)


def summed(targets: Iterable[Target], parts: Iterable[Array]) -> dict[str, Array]:
    """Readings by signal from those of its columns, each of shape (n,) and changed in place."""
    values: dict[str, Array] = {}
    for target, part in zip(targets, parts, strict=True):
        if values.setdefault(target.signal, part) is not part:
            values[target.signal] += part
    return values


def assign(
    path: Path,
    titles: Sequence[str],
    ruleset: Ruleset,
    notes: list[str],
    units: Sequence[str] = (),
    is_other: Callable[[str], bool] = lambda _: False,
) -> Header:
    """Which column is which signal.

    `units` are those that the file holds beside the titles, or empty; they count if title and
    column map name none. A column whose name `is_other` is taken under it, as it is. Raises
    `RecordingRefused`.
    """
    header = Header()
    foreign: dict[str, list[tuple[str, float, float]]] = {}
    wanted: dict[str, list[str]] = {}
    for c in ruleset.columns:
        foreign.setdefault(c.column.strip(), []).append((c.signal, c.factor, c.offset))
        wanted.setdefault(c.signal, []).append(c.column.strip())
    signals = ruleset.signal_by_id
    source: dict[str, dict[str, Target]] = {}
    bare: dict[str, str] = {}
    for index, title in enumerate(as_meant(t.strip()) for t in titles):
        name, unit = parts_of(title)
        beside = units[index].strip() if units else ""
        named = title != "" and title == ruleset.time_column
        if named or (header.time < 0 and is_time(title)):
            unit = unit.strip()
            if title.endswith(")") and parse_unit(unit, ruleset.units) is None:
                unit = ""  # as in 'Time (UTC)'
            header.time, header.time_title, header.time_unit = index, title, unit or beside
            continue
        mapped = next((one for one in (title, name) if one in foreign), "")
        if mapped:
            meant = foreign[mapped]
            inside = beside or ("" if title in foreign else unit)
            _tell_other(path, title, inside, "the column map", meant[0][1:], ruleset, notes)
        elif name in signals:
            unit = unit.strip() or beside
            if not unit:
                bare[title] = signals[name].unit
            try:
                meant = [(name, *conversion(signals[name], unit, ruleset.units))]
            except ValueError as error:
                raise RecordingRefused(f"{path}: column '{title}': {error}") from None
            _tell_other(path, title, beside, "its title", meant[0][1:], ruleset, notes)
        elif is_other(name):
            meant = [(name, 1.0, 0.0)]
        elif result_of(name, ruleset):
            raise RecordingRefused(
                f"{path}: '{title}' is a result of a module's observer; only rulec diagnose takes "
                "such a file"
            )
        else:
            if title:
                header.strangers.append(title)
            continue
        for signal, factor, offset in meant:
            before = source.setdefault(signal, {})
            if before and (mapped in before or len(wanted.get(signal, ())) < 2):
                first = titles[[*before.values()][-1].index].strip()
                raise RecordingRefused(
                    f"{path}: two columns hold {signal}: '{first}' and '{title}'; "
                    "take one of them out"
                )
            before[mapped] = Target(index, signal, factor, offset)
            header.targets.append(before[mapped])
    for signal, found in source.items():
        sole = found.get("")  # a column of its own counts, not the difference of others
        lacking = [one for one in wanted.get(signal, ()) if one not in found]
        if sole or lacking:
            header.targets = [t for t in header.targets if t.signal != signal or t is sole]
        if lacking and not sole:
            notes.append(_without_reading(path, signal, found, lacking))
    if bare:
        more = f" and {len(bare) - SHOWN} more" if len(bare) > SHOWN else ""
        assumed = ", ".join(f"{bare[t]} for '{t}'" for t in sorted(bare)[:SHOWN])
        one, many = "column names no unit; assumed is", "columns name no unit; assumed are"
        notes.append(f"{path.name}: {plural(len(bare), one, many)} {assumed}{more}")
    if header.time < 0:
        raise _without_time(path, header, ruleset.time_column)
    return header


def _without_reading(path: Path, signal: str, found: Iterable[str], lacking: Iterable[str]) -> str:
    """A note that a column of a sum or difference is missing, beside those that were found."""
    there, lost = (" and ".join(f"'{c}'" for c in columns) for columns in (found, lacking))
    return f"{path.name}: {signal} has no reading: {lost} is missing beside {there}"


def _without_time(path: Path, header: Header, expected: str) -> RecordingRefused:
    """The refusal of a file without a column of times; the plant may name one."""
    hint = ""
    if header.strangers and header.targets and not expected:
        names = " or ".join(f"'{name}'" for name in header.strangers[:SHOWN])
        hint = (
            f"; if it is {names}, rename it, or name it in the column map (columns.yaml) as "
            "'time: {from: ...}'"
        )
    text = f"there is no time column; expected '{expected or 'time [s]'}'{hint}"
    return RecordingRefused(f"{path}: {text}")


def foreign(name: str, ruleset: Ruleset) -> RecordingRefused:
    """The refusal of a file without any column of the plant."""
    first = ruleset.signals[0]
    example = ruleset.columns[0].column if ruleset.columns else f"{first.id} [{first.unit}]"
    return RecordingRefused(
        f"{name}: no column belongs to this plant. Expected columns such as '{example}'; foreign "
        "names need a column map (columns.yaml)"
    )


def result_of(name: str, ruleset: Ruleset) -> bool:
    """Whether a column is the estimate of an observer, as reported by its module."""
    kind, _, observer = name.partition(":")
    return kind == "q" and observer in ruleset.observer_by_id


def _tell_other(
    path: Path,
    title: str,
    beside: str,
    counts: str,
    conversion: tuple[float, float],
    ruleset: Ruleset,
    notes: list[str],
) -> None:
    """Note a unit in the file that differs from the one that counts."""
    if not beside:
        return
    found, sign = parse_unit(beside, ruleset.units), np.sign(conversion[0])
    said = tuple(sign * part for part in conversion)  # as a subtracted column has it
    if found is None or not np.allclose((found.factor, found.offset), said, rtol=1e-9):
        notes.append(
            f"{path.name}: the file says that '{title}' is in '{beside[:40]}', and {counts} says "
            f"otherwise; {counts} counts"
        )
