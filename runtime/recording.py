"""A recording: readings over time, in SI, with what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.csv_table import RecordingRefused
from runtime.plan import Array
from runtime.recording_file import ABSURD, RecordingFile, files_of, read_file
from runtime.ruleset import Ruleset

__all__ = ["Recording", "RecordingRefused", "read_recording"]

SHOWN = 5


@dataclass(frozen=True)
class Recording:
    """Readings of one plant.

    Attributes
    ----------
    time : shape (n,), s; increasing.
    values : per signal id an array, shape (n,), SI; NaN where there is no usable reading.
    segment : shape (n,); changes where one file ends and the next begins.
    missing : signals of the ruleset that the recording does not have.
    notes : what was found while reading, for the operator.
    left_out : rows of the files that are no part of it: how many, and why.
    one_clock : whether times of all its files are on one clock; where each begins anew, nobody
        knows how long a pause there was, nor which was first.
    """

    time: Array
    values: Mapping[str, Array]
    segment: np.ndarray
    missing: tuple[str, ...]
    notes: tuple[str, ...]
    left_out: tuple[tuple[int, str], ...] = ()
    one_clock: bool = True

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class _Part:
    """One file; `start` is the date of time 0 if the file has dates."""

    name: str
    time: Array
    values: Mapping[str, Array]
    dated: bool


def read_recording(path: Path, ruleset: Ruleset) -> Recording:
    """Read a CSV file (also .gz) or a folder of them.

    Columns are ``time [s]`` and ``<module>.<signal> [unit]``, or foreign names that the plant's
    column map knows. Raises `RecordingRefused` with a message for the operator.
    """
    notes: list[str] = []
    strangers: dict[str, None] = {}
    parts = []
    lost: list[tuple[int, str]] = []
    for name in files_of(path):
        file = read_file(name, ruleset, notes)
        strangers.update(dict.fromkeys(file.header.strangers))
        if file.left_out:
            lost.append((file.left_out, "another number of cells than the header"))
        parts.append(_part(file, notes, lost))
    used = ruleset.read
    signals = sorted({name for part in parts for name in part.values})
    if not used.intersection(signals):
        raise RecordingRefused(
            f"{path}: no column belongs to this plant. Expected columns such as "
            f"'{_example(ruleset)}'; foreign names need a column map (columns.yaml)"
        )
    parts, one_clock = _one_behind_the_other(path, parts, notes)
    missing = tuple(s.id for s in ruleset.signals if s.id in used and s.id not in signals)
    notes += _strangers(strangers, missing, ruleset)
    return Recording(
        np.concatenate([part.time for part in parts]),
        {
            name: np.concatenate(
                [part.values.get(name, np.full(len(part.time), np.nan)) for part in parts]
            )
            for name in signals
        },
        np.concatenate([np.full(len(part.time), i) for i, part in enumerate(parts)]),
        missing,
        tuple(dict.fromkeys(notes)),
        tuple(lost),
        one_clock,
    )


def _strangers(strangers: Iterable[str], missing: Sequence[str], ruleset: Ruleset) -> Iterator[str]:
    """A remark on columns of no use, where one may be what is missing or of another plant."""
    names = list(strangers)
    odd = [name for name in names if name.partition(".")[0] in ruleset.modules]
    if odd:
        yield (
            f"'{odd[0]}' is no signal of this plant's module {odd[0].partition('.')[0]}; "
            "is this a recording of another plant?"
        )
    if names and missing:
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        shown = ", ".join(f"'{name}'" for name in names[:SHOWN])
        yield f"columns that belong to no signal of this plant: {shown}{more}"


def _example(ruleset: Ruleset) -> str:
    if ruleset.columns:
        return ruleset.columns[0].column
    return f"{ruleset.signals[0].id} [{ruleset.signals[0].unit}]"


def _part(file: RecordingFile, notes: list[str], lost: list[tuple[int, str]]) -> _Part:
    """A file with its rows in order of time."""
    order = _order(file.path, file.time, notes, lost)
    values = {name: v[order] for name, v in file.values.items()}
    return _Part(file.path.name, file.time[order], values, file.dated)


def _order(
    path: Path, time: Array, notes: list[str], lost: list[tuple[int, str]]
) -> NDArray[np.intp]:
    """Indexes of the samples in order of time; of equal times the first one is kept.

    What is left out is added to `notes` and `lost`.
    """
    has_time = np.isfinite(time) & (np.abs(time) < ABSURD)
    if not has_time.any():
        raise RecordingRefused(f"{path}: no row has a usable time")
    kept = np.flatnonzero(has_time)
    order = kept[np.argsort(time[kept], kind="stable")]
    if np.any(np.diff(order) < 0):
        notes.append(f"{path.name}: the rows were not in order of time; they are now")
    first = np.concatenate([[True], np.diff(time[order]) > 0])
    for count, what in (
        (len(time) - len(kept), "have no usable time"),
        (len(order) - int(first.sum()), "repeat the time of another row"),
    ):
        if count:
            notes.append(f"{path.name}: {count} rows {what} and are left out")
            lost.append((count, f"they {what}"))
    result: NDArray[np.intp] = order[first]
    return result


def _one_behind_the_other(
    path: Path, parts: list[_Part], notes: list[str]
) -> tuple[list[_Part], bool]:
    """Files in order of time, and whether they are on one clock.

    Where their times overlap, in order of name, one after the other.
    """
    if len({part.dated for part in parts}) > 1:
        raise RecordingRefused(
            f"{path}: some files of this folder have dates, others plain seconds; "
            "diagnose them apart"
        )
    ordered = sorted(parts, key=lambda p: float(p.time[0]))
    if parts[0].dated:
        start = float(ordered[0].time[0])
        shown = datetime.fromtimestamp(start, UTC).isoformat(" ").removesuffix("+00:00")
        notes.append(f"time 0 s is {shown}")
        ordered = [replace(part, time=part.time - start) for part in ordered]
        parts = [replace(part, time=part.time - start) for part in parts]
    if _follow(ordered):
        return ordered, True
    result: list[_Part] = []
    names, end = [], 0.0
    for part in parts:
        step = float(np.median(np.diff(part.time))) if len(part.time) > 1 else 1.0
        begin = end + step if result else float(part.time[0])
        result.append(replace(part, time=part.time - part.time[0] + begin))
        end = float(result[-1].time[-1])
        names.append(f"{part.name} from {begin:g} s")
    shown = ", ".join(names[:SHOWN]) + (" ..." if len(names) > SHOWN else "")
    notes.append(f"the times of {len(parts)} files overlap; one behind the other now: {shown}")
    return result, False


def _follow(parts: Iterable[_Part]) -> bool:
    return all(a.time[-1] < b.time[0] for a, b in pairwise(parts))
