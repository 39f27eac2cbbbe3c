"""A recording: readings over time, in SI, with remarks on their flaws."""

from collections import Counter
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
from rulec_runtime.recordings.header import foreign
from rulec_runtime.recordings.larger_than_memory import copied, one_behind_the_other
from rulec_runtime.recordings.plant_calendar import Calendar, calendar_of, together
from rulec_runtime.recordings.recording_file import RecordingFile, files_of, read_file
from rulec_runtime.recordings.titles import parts_of

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
    scales : how the numbers of a signal with one column were read: SI = number * factor + offset.
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
    def cache(self) -> dict[object, Any]:
        """Results computed from it, see `once`."""
        return {}


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
    strangers, names, parts = dict[str, None](), list[str](), list[Recording]()
    for file in files:
        strangers.update(dict.fromkeys(file.header.strangers))
        names.append(file.path.name)
        parts.append(_in_time(file, notes))
    used = ruleset.read
    found = {name for part in parts for name in part.values}
    if not used & found:
        raise foreign(str(path), ruleset)
    joined, one_clock = _of_folder(path, names, parts, notes)
    if joined.calendar is not None:
        notes.append(joined.calendar.zero())
    notes += _strangers(list(strangers), ruleset, found)
    missing = tuple(s.id for s in ruleset.signals if s.id in used and s.id not in found)
    said = tuple(dict.fromkeys(notes))
    return replace(joined, missing=missing, notes=said, one_clock=one_clock)


def one_after_another(parts: Sequence[Recording], starts: Sequence[float]) -> Recording:
    """Recordings as one, in the order given; `starts` are the times at which their time is 0, s.

    Each file remains a segment. Only if all have dates, so has the whole.
    """
    times = [
        copied(part.time + start) if start else part.time
        for part, start in zip(parts, starts, strict=True)
    ]
    absent = [np.broadcast_to(np.full(1, np.nan), len(time)) for time in times]
    segments, behind = list[NDArray[np.intp]](), 0
    for part in parts:
        segments.append(part.segment + behind if behind else part.segment)
        behind += int(part.segment.max(initial=0)) + 1
    calendars = [part.calendar for part in parts if part.calendar is not None]
    return Recording(
        time=one_behind_the_other(times),
        values={
            name: one_behind_the_other(
                [part.values.get(name, none) for part, none in zip(parts, absent, strict=True)]
            )
            for name in sorted({name for part in parts for name in part.values})
        },
        segment=one_behind_the_other(segments),
        missing=(),
        notes=(),
        left_out=tuple(entry for part in parts for entry in part.left_out),
        clock=tuple(
            replace(c, time=c.time + start)
            for part, start in zip(parts, starts, strict=True)
            for c in part.clock
        ),
        scales={name: scale for part in parts for name, scale in part.scales.items()},
        calendar=together(calendars, starts) if len(calendars) == len(parts) else None,
    )


def _strangers(names: Sequence[str], ruleset: Ruleset, found: Collection[str]) -> Iterator[str]:
    """Remarks on columns that belong to no signal; they may be of one that was not `found`."""
    odd = [name for name in names if name.partition(".")[0] in ruleset.modules]
    if odd:
        missing = [s.id for s in ruleset.signals if s.id not in found]
        name, _, unit = (part.strip(" )") for part in odd[0].partition("("))
        near = nearest(parts_of(name)[0], missing)
        meant = f"did you mean '{near}'?" if near else "is this a recording of another plant?"
        if name in missing:
            meant = f"write the unit in square brackets: '{name} [{unit}]'"
        yield f"column '{odd[0]}' matches no signal of this plant; {meant}"
    if names:
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        shown = ", ".join(f"'{name}'" for name in names[:SHOWN])
        yield f"columns that belong to no signal of this plant: {shown}{more}"


def _in_time(file: RecordingFile, notes: list[str]) -> Recording:
    """A file in order of time, without unusable rows; with dates, its first time is 0."""
    name, lost = file.path.name, list[tuple[int, str]]()
    if file.left_out:
        lost.append((file.left_out, "another number of cells than the header"))
    columns = {"": file.time, **file.values}
    if file.zones is not None:
        columns[_ZONES] = file.zones

    def keep(stay: NDArray[np.bool_], has: str, have: str, what: str) -> None:
        if count := int((~stay).sum()):
            one, many = f"row {has} {what} and is", f"rows {have} {what} and are"
            notes.append(f"{name}: {plural(count, one, many)} left out")
            lost.append((count, f"they {have} {what}"))
            columns.update((key, copied(values[stay])) for key, values in columns.items())

    has_time = np.isfinite(file.time) & (np.abs(file.time) < common.ABSURD)
    if not has_time.any():
        raise RecordingRefused(f"{file.path}: no row has a usable time")
    keep(has_time, "has", "have", "no usable time")
    ordered = in_order(columns[""])
    if ordered.order is not None:
        notes.append(f"{name}: the rows were not in order of time; they are now")
        columns.update((key, copied(v[ordered.order])) for key, v in columns.items())
    columns[""] = ordered.time
    later = np.concatenate([[True], ordered.time[1:] > ordered.time[:-1]])
    keep(later, "repeats", "repeat", "the time of another row")
    time, zones, clock, calendar = columns.pop(""), columns.pop(_ZONES, None), ordered.sets, None
    if zones is not None:
        start = float(time[0])
        time = copied(time - start)
        clock = tuple(replace(c, time=c.time - start) for c in clock)
        calendar = calendar_of(time, start, zones)
    targets = file.header.targets
    columns_of = Counter(target.signal for target in targets)
    return Recording(
        time=time,
        values=columns,
        segment=np.broadcast_to(np.zeros(1, dtype=int), len(time)),
        missing=(),
        notes=(),
        left_out=tuple(lost),
        clock=clock,
        scales={t.signal: (t.factor, t.offset) for t in targets if columns_of[t.signal] == 1},
        calendar=calendar,
    )


def _of_folder(
    path: Path, names: Sequence[str], parts: Sequence[Recording], notes: list[str]
) -> tuple[Recording, bool]:
    """Files in order of time, and whether they are on one clock.

    Files whose times overlap are appended in order of name.
    """
    dated = [part.calendar.start for part in parts if part.calendar is not None]
    if dated and len(dated) < len(parts):
        raise RecordingRefused(
            f"{path}: some files of this folder have dates, others plain seconds; "
            "diagnose them apart"
        )
    starts = [start - min(dated) for start in dated] or [0.0] * len(parts)
    times = [part.time[[0, -1]] + start for part, start in zip(parts, starts, strict=True)]
    order = sorted(range(len(parts)), key=lambda i: float(times[i][0]))
    if all(times[i][1] < times[j][0] for i, j in pairwise(order)):
        return one_after_another([parts[i] for i in order], [starts[i] for i in order]), True
    whole = [part.time + start for part, start in zip(parts, starts, strict=True)]
    starts = [start + more for start, more in zip(starts, starts_behind(whole), strict=True)]
    begins = [f"{n} from {p.time[0] + s:g} s" for n, p, s in zip(names, parts, starts, strict=True)]
    shown = ", ".join(begins[:SHOWN]) + (" ..." if len(begins) > SHOWN else "")
    notes.append(f"the times of {len(parts)} files overlap; one behind the other now: {shown}")
    return one_after_another(parts, starts), False


def starts_behind(times: Sequence[Array]) -> list[float]:
    """Seconds to add to each series of times so that they follow one another."""
    starts: list[float] = []
    end = 0.0
    for time in times:
        begin = end + interval_of(time, 1.0) if starts else float(time[0])
        starts.append(begin - float(time[0]))
        end = starts[-1] + float(time[-1])
    return starts


Found = TypeVar("Found")


def once(function: Callable[[Recording, Ruleset], Found]) -> Callable[[Recording, Ruleset], Found]:
    """Cache the result of a function per recording and ruleset."""

    @wraps(function)
    def asked(recording: Recording, ruleset: Ruleset) -> Found:
        cached = recording.cache.get(asked)
        if cached is None or cached[0] is not ruleset:
            cached = recording.cache[asked] = ruleset, function(recording, ruleset)
        found: Found = cached[1]
        return found

    return asked
