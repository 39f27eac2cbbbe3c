"""A recording: readings over time, in SI, with remarks on their flaws."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.nearest import nearest
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.clock_set_back import ClockSet, in_order
from rulec_runtime.recordings.columns import interval_of
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.header import foreign, parts_of
from rulec_runtime.recordings.larger_than_memory import array, kept, one_behind_the_other
from rulec_runtime.recordings.plant_calendar import Calendar, calendar_of
from rulec_runtime.recordings.recording_file import RecordingFile, files_of, read_file

__all__ = ["Recording", "RecordingRefused", "read_recording"]

SHOWN = 5

_ZONES = "zones"
"""Name among the columns of a file; no signal has it."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Readings of one plant.

    Attributes
    ----------
    time : shape (n,), s; increasing.
    values : per signal id an array, shape (n,), SI; NaN where there is no usable reading.
    segment : shape (n,); changes from one file to the next.
    missing : signals of the ruleset that the recording lacks.
    notes : remarks for the operator.
    left_out : numbers of rows of the files that were left out, with reasons.
    one_clock : whether times of all files are on one clock; otherwise pauses and order of the files
        are unknown.
    clock : when, and by how much, the clock of the logger was set during the recording.
    unfit : per signal why readings were removed; None before the check.
    scales : per signal how the numbers of its column were read: SI = number * factor + offset.
    calendar : the date of time 0, if the file has dates.
    sources : names of the recordings that it joins, in the order given; empty for a single one.
    source : shape (n,), the number of the recording of each row; None for a single one.
    origin : shape (n,), s; the time at which the clock of each row's recording begins; None if all
        share one clock.
    """

    time: Array
    values: Mapping[str, Array]
    segment: np.ndarray
    missing: tuple[str, ...]
    notes: tuple[str, ...]
    left_out: tuple[tuple[int, str], ...] = ()
    one_clock: bool = True
    clock: tuple[ClockSet, ...] = ()
    unfit: Mapping[str, str] | None = None
    scales: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    calendar: Calendar | None = None
    sources: tuple[str, ...] = ()
    source: NDArray[np.intp] | None = None
    origin: Array | None = None

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def interval(self) -> float:
        """The usual time between samples, s; 0 for a single one."""
        return interval_of(self.time, 0.0)

    @cached_property
    def kept(self) -> dict[object, Any]:
        """Results computed from it, see `once`."""
        return {}


@dataclass(frozen=True)
class _Part:
    """One file; `zones` are seconds ahead of UTC, if it has dates."""

    name: str
    time: Array
    values: Mapping[str, Array]
    zones: Array | None
    clock: tuple[ClockSet, ...]


def read_recording(path: Path, ruleset: Ruleset) -> Recording:
    """Read a CSV file (also .gz) or a folder of them.

    Columns are ``time [s]`` and ``<module>.<signal> [unit]``, or foreign names that the plant's
    column map knows. Raises `RecordingRefused` with a message for the operator.
    """
    notes: list[str] = []
    files = (read_file(name, ruleset, notes) for name in files_of(path))
    return recording_of(path, files, ruleset, notes)


def recording_of(
    path: Path, files: Iterable[RecordingFile], ruleset: Ruleset, notes: list[str]
) -> Recording:
    """One recording from one file, or from those of a folder.

    `path` is its name for the user, `notes` are remarks on the files. Raises `RecordingRefused`.
    """
    strangers: dict[str, None] = {}
    parts = []
    lost: list[tuple[int, str]] = []
    scales: dict[str, tuple[float, float]] = {}
    for file in files:
        scales |= {t.signal: (t.factor, t.offset) for t in file.header.targets}
        strangers.update(dict.fromkeys(file.header.strangers))
        if file.left_out:
            lost.append((file.left_out, "another number of cells than the header"))
        parts.append(_part(file, notes, lost))
    used = ruleset.read
    signals = sorted({name for part in parts for name in part.values})
    if not used.intersection(signals):
        raise foreign(str(path), ruleset)
    start = min(float(part.time[0]) for part in parts)
    parts, one_clock = _one_behind_the_other(path, parts, notes)
    calendar = _calendar(start, parts)
    if calendar is not None:
        notes.append(calendar.zero())
    missing = tuple(s.id for s in ruleset.signals if s.id in used and s.id not in signals)
    notes += _strangers(list(strangers), ruleset, signals)
    absent = [np.broadcast_to(np.full(1, np.nan), len(part.time)) for part in parts]
    columns = {
        name: [part.values.get(name, none) for part, none in zip(parts, absent, strict=True)]
        for name in signals
    }
    return Recording(
        time=one_behind_the_other([part.time for part in parts]),
        values={name: one_behind_the_other(column) for name, column in columns.items()},
        segment=_segments([len(part.time) for part in parts]),
        missing=missing,
        notes=tuple(dict.fromkeys(notes)),
        left_out=tuple(lost),
        one_clock=one_clock,
        clock=tuple(clock for part in parts for clock in part.clock),
        scales=scales,
        calendar=calendar,
    )


def _segments(lengths: Sequence[int]) -> NDArray[np.intp]:
    """The number of the file of each row; a single file takes no memory."""
    if len(lengths) == 1:
        return np.broadcast_to(np.zeros(1, dtype=int), lengths[0])
    found, done = array(sum(lengths), int), 0
    for number, length in enumerate(lengths):
        found[done : done + length] = number
        done += length
    return found


def _strangers(names: Sequence[str], ruleset: Ruleset, found: Collection[str]) -> Iterator[str]:
    """Remarks on columns that belong to no signal; they may be of one that was not `found`."""
    odd = [name for name in names if name.partition(".")[0] in ruleset.modules]
    if odd:
        missing = [s.id for s in ruleset.signals if s.id not in found]
        yield f"column '{odd[0]}' matches no signal of this plant; {_meant(odd[0], missing)}"
    if names:
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        shown = ", ".join(f"'{name}'" for name in names[:SHOWN])
        yield f"columns that belong to no signal of this plant: {shown}{more}"


def _meant(title: str, missing: Sequence[str]) -> str:
    """What the title of an unknown column may mean, given the signals that no column holds."""
    name, _, unit = (part.strip(" )") for part in title.partition("("))
    if name in missing:
        return f"write the unit in square brackets: '{name} [{unit}]'"
    near = nearest(parts_of(name)[0], missing)
    return f"did you mean '{near}'?" if near else "is this a recording of another plant?"


def _part(file: RecordingFile, notes: list[str], lost: list[tuple[int, str]]) -> _Part:
    """A file in order of time, without unusable rows."""
    has_time = np.isfinite(file.time) & (np.abs(file.time) < common.ABSURD)
    if not has_time.any():
        raise RecordingRefused(f"{file.path}: no row has a usable time")
    columns = {"": file.time, **file.values}
    if file.zones is not None:
        columns[_ZONES] = file.zones
    reason = ("has", "have"), "no usable time"
    columns = _without(columns, has_time, file.path, *reason, notes, lost)
    ordered = in_order(columns[""])
    if ordered.sorted:
        notes.append(f"{file.path.name}: the rows were not in order of time; they are now")
    if ordered.order is not None:
        columns = {name: kept(v[ordered.order]) for name, v in columns.items()}
    columns[""] = ordered.time
    reason = ("repeats", "repeat"), "the time of another row"
    later = np.concatenate([[True], ordered.time[1:] > ordered.time[:-1]])
    columns = _without(columns, later, file.path, *reason, notes, lost)
    time, zones = columns.pop(""), columns.pop(_ZONES, None)
    return _Part(file.path.name, time, columns, zones, ordered.sets)


def _without(
    columns: dict[str, Array],
    stay: NDArray[np.bool_],
    path: Path,
    verb: tuple[str, str],
    what: str,
    notes: list[str],
    lost: list[tuple[int, str]],
) -> dict[str, Array]:
    """Columns with the rows `stay` alone; the others are noted and counted."""
    count = int(stay.sum())
    if count == len(stay):
        return columns
    one, many = (f"row {verb[0]} {what} and is", f"rows {verb[1]} {what} and are")
    notes.append(f"{path.name}: {plural(len(stay) - count, one, many)} left out")
    lost.append((len(stay) - count, f"they {verb[1]} {what}"))
    return {name: kept(values[stay]) for name, values in columns.items()}


def _one_behind_the_other(
    path: Path, parts: list[_Part], notes: list[str]
) -> tuple[list[_Part], bool]:
    """Files in order of time, and whether they are on one clock.

    Files whose times overlap are appended in order of name.
    """
    if len({part.zones is None for part in parts}) > 1:
        raise RecordingRefused(
            f"{path}: some files of this folder have dates, others plain seconds; "
            "diagnose them apart"
        )
    ordered = sorted(parts, key=lambda p: float(p.time[0]))
    if parts[0].zones is not None:
        start = float(ordered[0].time[0])
        ordered = [_moved(part, -start) for part in ordered]
        parts = [_moved(part, -start) for part in parts]
    if all(a.time[-1] < b.time[0] for a, b in pairwise(ordered)):
        return ordered, True
    starts = starts_behind([part.time for part in parts])
    result = [_moved(part, start) for part, start in zip(parts, starts, strict=True)]
    names = [f"{part.name} from {part.time[0]:g} s" for part in result]
    shown = ", ".join(names[:SHOWN]) + (" ..." if len(names) > SHOWN else "")
    notes.append(f"the times of {len(parts)} files overlap; one behind the other now: {shown}")
    return result, False


def starts_behind(times: Sequence[Array]) -> list[float]:
    """Seconds to add to each series of times so that they follow one another."""
    starts: list[float] = []
    end = 0.0
    for time in times:
        begin = end + interval_of(time, 1.0) if starts else float(time[0])
        starts.append(begin - float(time[0]))
        end = starts[-1] + float(time[-1])
    return starts


def _moved(part: _Part, seconds: float) -> _Part:
    clock = tuple(replace(c, time=c.time + seconds) for c in part.clock)
    return replace(part, time=kept(part.time + seconds), clock=clock)


def _calendar(start: float, parts: Sequence[_Part]) -> Calendar | None:
    """Dates of a recording that begins at `start`, if its files have any."""
    zones = [part.zones for part in parts if part.zones is not None]
    if len(zones) < len(parts):
        return None
    time = one_behind_the_other([p.time for p in parts])
    return calendar_of(time, start, one_behind_the_other(zones))


Found = TypeVar("Found")


def once(function: Callable[[Recording, Ruleset], Found]) -> Callable[[Recording, Ruleset], Found]:
    """Cache the result of a function per recording and ruleset."""

    @wraps(function)
    def asked(recording: Recording, ruleset: Ruleset) -> Found:
        known = recording.kept.get(asked)
        if known is None or known[0] is not ruleset:
            known = recording.kept[asked] = ruleset, function(recording, ruleset)
        found: Found = known[1]
        return found

    return asked
