"""Tables in which each column of readings stands behind one of its own times, as trends are
exported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import Column
from rulec_runtime.recordings.long_table import LongTable, Readings
from rulec_runtime.recordings.places import Pair
from rulec_runtime.recordings.quality import codes_told, judged
from rulec_runtime.recordings.table import Cells, Dates, Sheet, lines_of, texts_of
from rulec_runtime.recordings.time_column import comparable, seconds_in


def pair_sheet(path: Path, sheet: Sheet, pairs: Sequence[Pair], form: FileForm) -> Sheet:
    """A table with one time of one in pairs."""
    asked = [*(p.time for p in pairs), *(p.quality for p in pairs if p.quality >= 0)]
    table = sheet.read(asked, [p.value for p in pairs], replace(form, layout="pairs"))
    told = dict(zip(asked, table.kept, strict=True))
    seen = list[str]()
    times = [comparable(path, told[p.time], form, seen) for p in pairs]
    readings, decimals, low = [], set(), 0
    qualities = {p: texts_of(told[p.quality]) for p in pairs if p.quality >= 0}
    found = set().union(*qualities.values())
    if found:
        seen += codes_told(path, sheet.titles[next(iter(qualities)).quality], found, form)
    for pair, column, own in zip(pairs, table.columns, times, strict=True):
        if pair.quality >= 0:
            title = sheet.titles[pair.quality]
            column = judged(path, column, title, qualities[pair], found, form)
        readings.append(_readings(column, own, form, low))
        decimals |= column.decimals
        low += len(own)
    left_out = table.left_out, table.first_left_out
    titles = tuple(p.title for p in pairs)
    long = LongTable(path, titles, tuple(readings), _joined(times), form, 0, left_out, decimals)
    count = f"columns in pairs of time and reading; {plural(len(pairs), 'pair', 'pairs')}"
    return replace(
        sheet,
        titles=(
            "time" if isinstance(long.times, Dates) else sheet.titles[pairs[0].time],
            *long.tags,
        ),
        units=(sheet.units[pairs[0].time], *(sheet.units[p.value] for p in pairs)),
        read=long.read,
        lines=lambda: lines_of(long.read, len(long.tags) + 1),
        rows=None,
        remarks=(*sheet.remarks, *table.remarks, count, *dict.fromkeys(seen)),
    )


def _readings(column: Column, times: Cells, form: FileForm, low: int) -> Readings:
    """Readings of a column whose first time is that with the number `low`."""
    seconds, numbers = seconds_in(times, form), column.numbers()
    words = column.placed or {}
    there = np.isfinite(numbers)
    there[[*words]] = True
    rows = np.flatnonzero(there & np.isfinite(seconds))
    rows = rows[np.argsort(seconds[rows], kind="stable")]
    own = {k: words[row] for k, row in enumerate(rows.tolist()) if row in words}
    return Readings(rows + low, seconds[rows], numbers[rows], own)


def _joined(times: Sequence[Cells]) -> Cells:
    if all(isinstance(one, Dates) for one in times):
        dates = [one for one in times if isinstance(one, Dates)]
        return Dates(
            np.concatenate([d.seconds for d in dates]), np.concatenate([d.zones for d in dates])
        )
    return np.concatenate([np.asarray(texts, dtype=float) for texts in times])
