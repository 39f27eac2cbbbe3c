"""Join several recordings of one plant, each with a clock of its own.

Recordings with dates share one axis of time. Without dates the pauses between them are unknown:
they follow one another in the order given, and the clock of each restarts. Each keeps its number,
so that a quantity such as the zero of a sensor can differ between recordings.
"""

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.columns import means_between
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.formats import bytes_of, file_and_table
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.point_table import is_point_table
from rulec_runtime.recordings.recording import (
    Recording,
    one_after_another,
    read_recording,
    starts_behind,
)
from rulec_runtime.recordings.recording_file import files_of
from rulec_runtime.recordings.stationary import find_stretches, noise_at_work

OWN_CLOCKS = (
    "the files have no dates, so nobody knows the pauses between the recordings: what follows time "
    "begins anew in each, and a fault that began lasts through those behind it"
)
"""The remark on recordings without dates."""


def read_recordings(paths: Sequence[Path], ruleset: Ruleset) -> Recording:
    """Read one recording, or join several of one plant.

    Raises `RecordingRefused` if they cannot be judged together.
    """
    if len(paths) == 1:
        return read_recording(paths[0], ruleset)
    check_different(paths)
    return together(paths, [read_recording(path, ruleset) for path in paths], ruleset)


def check_different(paths: Sequence[Path]) -> None:
    """Refuse files with the same content."""
    files: dict[str, Path] = {}
    for path in paths:
        for file in files_of(path):
            digest = hashlib.sha256(bytes_of(file)).hexdigest() + file_and_table(file)[1]
            if digest in files:
                other = files[digest]
                what = "the same file" if file == other else f"a copy of {other}"
                raise RecordingRefused(
                    f"{file}: this is {what}, given twice; what it shows would count twice. Give "
                    "each recording once"
                )
            files[digest] = file


def together(paths: Sequence[Path], parts: Sequence[Recording], ruleset: Ruleset) -> Recording:
    """Join recordings that were read from `paths`."""
    names = names_of(paths)
    _check_alike(names, parts)
    parts = _alike(names, parts, ruleset)
    dated = [part.calendar for part in parts if part.calendar is not None]
    one_axis = len(dated) == len(parts)
    if one_axis:
        starts = _dated_starts(names, parts, dated)
    else:
        starts = starts_behind([part.time for part in parts])
    order = sorted(range(len(parts)), key=lambda i: starts[i])
    joined = one_after_another([parts[i] for i in order], [starts[i] for i in order])
    counts = [len(parts[i]) for i in order]
    begin = [starts[i] + float(parts[i].time[0]) for i in order]
    shown = [f"{n} from {s + p.time[0]:g} s" for n, s, p in zip(names, starts, parts, strict=True)]
    notes = [f"times of all recordings stand on one axis: {', '.join(shown)}"]
    notes += [] if one_axis else [OWN_CLOCKS]
    if dated and not one_axis:
        notes.append("some recordings have dates, others none: the dates are not used")
    notes += [joined.calendar.zero()] if joined.calendar is not None else []
    for name, part in zip(names, parts, strict=True):
        own = part.calendar.zero() if part.calendar is not None else ""
        about = f"{name}: "
        notes += [about + note.removeprefix(about) for note in part.notes if note != own]
    return replace(
        joined,
        missing=parts[0].missing,
        notes=tuple(dict.fromkeys(notes)),
        one_clock=all(part.one_clock for part in parts),
        sources=names,
        source=np.repeat(np.array(order, dtype=np.intp), counts),
        origin=None if one_axis else np.repeat(begin, counts),
    )


def part_of(recording: Recording, numbers: Collection[int]) -> Recording:
    """Some of the joined recordings, by their numbers; their times stay."""
    assert recording.source is not None
    rows = np.isin(recording.source, list(numbers))
    several = len(numbers) > 1
    new = np.cumsum([number in numbers for number in range(len(recording.sources))]) - 1
    source = new[recording.source[rows]]
    return replace(
        recording,
        time=recording.time[rows],
        values={name: values[rows] for name, values in recording.values.items()},
        segment=recording.segment[rows],
        sources=tuple(recording.sources[i] for i in sorted(numbers)) if several else (),
        source=source if several else None,
        origin=None if recording.origin is None else recording.origin[rows],
    )


def names_of(paths: Sequence[Path]) -> tuple[str, ...]:
    """Name of each recording: its file, with its folder if two names are equal."""
    names = [path.resolve().name for path in paths]
    return tuple(
        name if names.count(name) == 1 else f"{path.resolve().parent.name}/{name}"
        for name, path in zip(names, paths, strict=True)
    )


def _check_alike(names: Sequence[str], parts: Sequence[Recording]) -> None:
    """Refuse recordings with different columns or units."""
    first, columns = parts[0], parts[0].values.keys()
    for name, part in zip(names[1:], parts[1:], strict=True):
        lacking, more = sorted(columns - part.values.keys()), sorted(part.values.keys() - columns)
        if lacking or more:
            has, lacks = (names[0], name) if lacking else (name, names[0])
            raise RecordingRefused(
                f"{lacks} has no column {(lacking or more)[0]}, and {has} has one: are both of "
                "this plant, with the same sensors? Give both the same columns, or judge each alone"
            )
        for signal in sorted(first.scales.keys() & part.scales.keys()):
            if first.scales[signal] != part.scales[signal]:
                raise RecordingRefused(
                    f"{name}: the column of {signal} is in another unit than in {names[0]}; write "
                    "both in one unit, or judge each alone"
                )


def _alike(
    names: Sequence[str], parts: Sequence[Recording], ruleset: Ruleset
) -> Sequence[Recording]:
    """Turn courses in time into tables of operating points if another recording is one."""
    kinds = [is_point_table(part, ruleset) for part in parts]
    if all(kinds) or not any(kinds):
        return parts
    table = names[kinds.index(True)]
    return [
        part if kind else _as_table(name, part, ruleset, table)
        for name, part, kind in zip(names, parts, kinds, strict=True)
    ]


def _as_table(name: str, part: Recording, ruleset: Ruleset, other: str) -> Recording:
    """One row per settled state of a course: means of its readings."""
    states = find_stretches(part, ruleset, noise_at_work(part, ruleset), longest=len(part))
    if not len(states):
        raise RecordingRefused(
            f"{name}: it never settles, and {other} is a table of operating points; hold each set "
            "point until readings rest, or judge each alone"
        )
    first, last = states.first, states.last
    count = plural(len(states), "state in which it rests is", "states in which it rests are")
    note = f"its {count} taken as operating points, as {other} is a table of such"
    return replace(
        part,
        time=means_between(part.time, first, last)[0],
        values={n: means_between(values, first, last)[0] for n, values in part.values.items()},
        segment=part.segment[first],
        notes=(*part.notes, note),
    )


def _dated_starts(
    names: Sequence[str], parts: Sequence[Recording], calendars: Sequence[Calendar]
) -> list[float]:
    """Time 0 of each recording on the common axis, s; refuses recordings that overlap."""
    zones = [bool(calendar.offsets) for calendar in calendars]
    if any(zones) and not all(zones):
        raise RecordingRefused(
            f"the dates of {names[zones.index(True)]} name a zone, those of "
            f"{names[zones.index(False)]} none: nobody knows which was first. Write the zone into "
            "all, or into none"
        )
    zero = min(calendar.start for calendar in calendars)
    starts = [calendar.start - zero for calendar in calendars]
    order = sorted(range(len(parts)), key=lambda i: starts[i])
    for i, j in pairwise(order):
        if parts[i].time[-1] + starts[i] >= parts[j].time[0] + starts[j]:
            raise RecordingRefused(
                f"{names[i]} and {names[j]} were recorded at the same time; what happened once "
                "would count twice. Put columns of one time into one file"
            )
    return starts
