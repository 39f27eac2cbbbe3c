"""Read MDF files (versions 3 and 4): each channel group is a table with its own clock."""

from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from asammdf import MDF

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.arrays import array_sheet
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.table import Dates, Sheet

FORMULA = {3: 10, 4: 3}
"""Type of a conversion by a text formula, per main version of the format."""


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """Tables of an MDF file. Times count from its start, and are dates if it states one."""
    source = MDF(file)
    found = [_sheet(source, k) for k, group in enumerate(source.groups) if group.channels]
    tables = [sheet for sheet in found if sheet is not None]
    if not tables:
        raise RecordingRefused(f"{path}: no channel group in it has a clock and a channel")
    return tables


def _sheet(source: MDF, number: int) -> Sheet | None:
    group = source.groups[number]
    master = source.masters_db.get(number)
    if master is None:
        return None
    version = int(str(source.version)[0])
    usual = [k for k in range(len(group.channels)) if k != master]
    formulas = [k for k in usual if _has_formula(group.channels[k].conversion, version)]
    channels = [k for k in usual if k not in formulas]
    rows = int(group.channel_group.cycles_nr)
    if not channels or not rows:
        return None
    stated: datetime = source.header.start_time
    start = stated if stated.year > 1970 else None

    def pieces(indexes: Sequence[int]) -> Iterator[list[Any]]:
        yield [
            _times(source.get_master(number), start)
            if not i
            else source.get(group=number, index=channels[i - 1], samples_only=True)[0]
            for i in indexes
        ]

    titles = [group.channels[k].name.partition("\\")[0] for k in channels]
    units = [
        str(c.unit or getattr(c.conversion, "unit", "") or "").strip("\0 ")
        for c in (group.channels[k] for k in channels)
    ]
    remarks = [
        f"'{group.channels[k].name}' is to be calculated by a formula in the file, which is not "
        "evaluated"
        for k in formulas
    ]
    return array_sheet(
        _name(source, number), ["time", *titles], ["s", *units], rows, pieces, tuple(remarks)
    )


def _name(source: MDF, number: int) -> str:
    """Name of a group: its acquisition name if unique, else its number from 0."""
    names = [str(getattr(g.channel_group, "acq_name", "") or "").strip() for g in source.groups]
    name = names[number]
    return name if name and names.count(name) == 1 else f"group {number}"


def _has_formula(conversion: Any, version: int) -> bool:
    """Whether a conversion, or one to which it refers, is a formula."""
    if conversion is None:
        return False
    if conversion.conversion_type == FORMULA.get(version):
        return True
    inner = (getattr(conversion, "referenced_blocks", None) or {}).values()
    return any(_has_formula(part, version) for part in inner if hasattr(part, "conversion_type"))


def _times(seconds: Array, start: datetime | None) -> Any:
    """Dates from seconds since the start, rounded to microseconds; the seconds without a start."""
    if start is None:
        return np.asarray(seconds, dtype=float)
    zone = start.utcoffset()
    begin = (start if start.tzinfo else start.replace(tzinfo=UTC)) - datetime.fromtimestamp(0, UTC)
    whole = (begin.days * 86400 + begin.seconds) * 1_000_000 + begin.microseconds
    micro = whole + np.round(np.asarray(seconds, dtype=float) * 1e6)
    ahead = np.nan if zone is None else zone.total_seconds()
    return Dates(micro / 1e6, np.full(len(micro), ahead))
