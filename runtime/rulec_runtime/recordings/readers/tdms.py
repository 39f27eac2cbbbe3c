"""Read TDMS files: each group is a table, or several if its channels have different rates."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from nptdms import TdmsFile

from rulec_runtime.recordings.arrays import array_sheet, seconds_of
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.table import Dates, Sheet
from rulec_runtime.recordings.titles import is_time

UNITS = ("unit_string", "NI_UnitDescription", "unit", "units")
"""Properties that may hold the unit of a channel."""

STEP, START, OFFSET = "wf_increment", "wf_start_time", "wf_start_offset"


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """Tables of a TDMS file. Their time is a channel with such a name, or that of waveforms."""
    source = TdmsFile.open(file)
    found = [sheet for group in source.groups() for sheet in _sheets(group, times)]
    if not found:
        raise RecordingRefused(f"{path}: no channel in it holds readings")
    return found


def _sheets(group: Any, times: Collection[str]) -> Iterator[Sheet]:
    """A table for all channels of one length and one rate."""
    alike: dict[tuple[Any, ...], list[Any]] = {}
    timed = {len(c) for c in group.channels() if is_time(c.name, times)}
    for channel in group.channels():
        if len(channel) == 0:
            continue
        rate = tuple(channel.properties.get(key) for key in (STEP, START, OFFSET))
        key = (len(channel),) if len(channel) in timed else (len(channel), *map(str, rate))
        alike.setdefault(key, []).append(channel)
    for channels in alike.values():
        yield _sheet(_name(group.name, channels, len(alike)), channels, times)


def _name(group: str, channels: Sequence[Any], several: int) -> str:
    if several == 1:
        return group
    step = channels[0].properties.get(STEP)
    return f"{group}/{len(channels[0])} rows" + (f" at {step:g} s" if step else "")


def _sheet(name: str, channels: Sequence[Any], times: Collection[str]) -> Sheet:
    titles, units = [c.name for c in channels], [_unit(c) for c in channels]
    own = not any(is_time(title, times) for title in titles) and STEP in channels[0].properties
    if own:
        titles, units = ["time", *titles], ["s", *units]

    def pieces(indexes: Sequence[int]) -> Iterator[list[Any]]:
        yield [_track(channels[0]) if own and not i else _values(channels[i - own])
               for i in indexes]  # fmt: skip

    return array_sheet(name, titles, units, len(channels[0]), pieces)


def _unit(channel: Any) -> str:
    found = (channel.properties.get(key) for key in UNITS)
    return next((str(unit).strip() for unit in found if unit), "")


def _values(channel: Any) -> Any:
    """Readings; TDMS keeps dates in UTC."""
    values = channel[:]
    if values.dtype.kind == "M":
        seconds = seconds_of(values)
        return Dates(seconds, np.zeros(len(seconds)))
    return values


def _track(channel: Any) -> Any:
    """Times of a waveform: dates in UTC if it states its start, else seconds."""
    step = float(channel.properties[STEP])
    seconds = float(channel.properties.get(OFFSET, 0.0)) + step * np.arange(len(channel))
    start = channel.properties.get(START)
    if start is None:
        return seconds
    whole = np.datetime64(start).astype("M8[us]").astype(np.int64)
    return Dates((whole + np.round(seconds * 1e6)) / 1e6, np.zeros(len(seconds)))
