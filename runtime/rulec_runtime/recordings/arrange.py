"""Rearrange a table into one with a column per signal and one time: long tables, pairs of columns
and columns of qualities are recognised by the column map or by their titles."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rulec_runtime.contract.file_form import INFERRED, FileForm
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.column_roles import ColumnRoles, Pair, roles_of
from rulec_runtime.recordings.long_table import LongTable, Readings, held, long_sheet, rows_written
from rulec_runtime.recordings.quality import codes_remark, judged
from rulec_runtime.recordings.table import Cells, Dates, Sheet, Table, lines_of, texts_of
from rulec_runtime.recordings.time_column import TimeReader, seconds_in, time_of_parts


def arrange(path: Path, sheet: Sheet, form: FileForm) -> Sheet:
    """A table with a column per signal. Raises `RecordingRefused` if it contradicts its column
    map."""
    roles = roles_of(path, sheet.titles, form)
    if roles.layout == "long":
        return long_sheet(path, sheet, roles, form)
    if roles.layout == "pairs":
        return pair_sheet(path, sheet, roles.pairs, form)
    if len(roles.time) < 2 and not roles.quality_of and form.hold != "last":
        return sheet
    return wide_sheet(path, sheet, roles, form)


def wide_sheet(path: Path, sheet: Sheet, roles: ColumnRoles, form: FileForm) -> Sheet:
    """A table without its columns of qualities and with one column of time."""
    aside = {*roles.time[1:], *(roles.quality_of or {}).values()}
    there = [i for i in range(len(sheet.titles)) if i not in aside]
    titles = [sheet.titles[i] for i in there]
    if len(form.time) > 1:
        titles[there.index(roles.time[0])] = form.time_title

    def read(raw: Sequence[int], numbers: Sequence[int], _: FileForm = INFERRED) -> Table:
        wanted = [there[i] for i in raw], [there[i] for i in numbers]
        return _read_wide(path, sheet, roles, form, *wanted)

    return replace(
        sheet,
        titles=tuple(titles),
        units=tuple(sheet.units[i] for i in there),
        read=read,
        lines=lambda: lines_of(read, len(there)),
    )


def _read_wide(
    path: Path, sheet: Sheet, roles: ColumnRoles, form: FileForm, raw: list[int], numbers: list[int]
) -> Table:
    """Columns of a table, read together with the other parts of its time and with qualities."""
    judges = {i: q for i, q in (roles.quality_of or {}).items() if i in numbers}
    parts = roles.time if len(roles.time) > 1 or form.hold == "last" else ()
    table = sheet.read([*raw, *parts, *judges.values()], numbers, form)
    cells, beside = table.raw[: len(raw)], table.raw[len(raw) :]
    columns = dict(zip(numbers, table.columns, strict=True))
    qualities = [texts_of(cells) for cells in beside[len(parts) :]]
    found = set().union(*qualities)
    remarks = table.remarks
    if found:
        title = sheet.titles[next(iter(judges.values()))]
        remarks = (*remarks, *codes_remark(path, title, found, form))
    for (index, quality), texts in zip(judges.items(), qualities, strict=True):
        columns[index] = judged(path, columns[index], sheet.titles[quality], texts, found, form)
    if parts:
        time, remarks = time_of_parts(path, beside[: len(parts)], form, remarks)
        cells = tuple(time if i == parts[0] else c for i, c in zip(raw, cells, strict=True))
        if form.hold == "last":
            columns, remarks = held(columns, time, form, remarks)
    return replace(table, raw=cells, columns=tuple(columns[i] for i in numbers), remarks=remarks)


def pair_sheet(path: Path, sheet: Sheet, pairs: Sequence[Pair], form: FileForm) -> Sheet:
    """A table with one time, made from pairs of columns."""
    asked = [*(p.time for p in pairs), *(p.quality for p in pairs if p.quality >= 0)]
    table = sheet.read(asked, [p.value for p in pairs], replace(form, layout="pairs"))
    cells = dict(zip(asked, table.raw, strict=True))
    notes = list[str]()
    times = [TimeReader(path, form, notes).read(cells[p.time]) for p in pairs]
    qualities = {p: texts_of(cells[p.quality]) for p in pairs if p.quality >= 0}
    found = set().union(*qualities.values())
    if found:
        notes += codes_remark(path, sheet.titles[next(iter(qualities)).quality], found, form)
    readings, decimals, low, words = list[Readings](), set[str](), 0, dict[int, str]()
    for pair, column, own in zip(pairs, table.columns, times, strict=True):
        if pair.quality >= 0:
            title = sheet.titles[pair.quality]
            column = judged(path, column, title, qualities[pair], found, form)
        seconds, numbers = seconds_in(own, form), column.numbers()
        rows = rows_written(numbers, column, seconds)
        readings.append(Readings(rows + low, seconds[rows], numbers[rows]))
        words |= {row + low: word for row, word in (column.placed or {}).items()}
        decimals |= column.decimals
        low += len(own)
    dates = [one for one in times if isinstance(one, Dates)]
    if len(dates) == len(times):
        parts = [d.seconds for d in dates], [d.zones for d in dates]
        joined: Cells = Dates(*map(np.concatenate, parts))
    else:
        joined = np.concatenate([np.asarray(texts, dtype=float) for texts in times])
    left_out = table.left_out, table.first_left_out
    titles = tuple(p.title for p in pairs)
    long = LongTable(path, titles, tuple(readings), joined, words, form, 0, left_out, decimals)
    count = f"columns in pairs of time and reading; {plural(len(pairs), 'pair', 'pairs')}"
    time = "time" if isinstance(long.times, Dates) else sheet.titles[pairs[0].time]
    return replace(
        sheet,
        titles=(time, *titles),
        units=(sheet.units[pairs[0].time], *(sheet.units[p.value] for p in pairs)),
        read=long.read,
        lines=lambda: lines_of(long.read, len(titles) + 1),
        rows=None,
        remarks=(*sheet.remarks, *table.remarks, count, *dict.fromkeys(notes)),
    )
