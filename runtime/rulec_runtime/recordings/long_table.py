"""Turn long tables of historians, with a row per tag, time and value, into a column per tag.

Tags have times of their own. The rows are those of the tag with the most readings; a reading goes
to the row nearest to its time, within half the usual distance of rows. If the column map says that
readings hold, it goes to all rows until the next one. A remark counts readings without a row.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.file_form import INFERRED, FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.column_roles import ColumnRoles
from rulec_runtime.recordings.columns import interval_of, nearest
from rulec_runtime.recordings.csv_table import Column, RecordingRefused, Unclear
from rulec_runtime.recordings.larger_than_memory import Growing
from rulec_runtime.recordings.quality import as_word, codes_remark, good_of
from rulec_runtime.recordings.table import Cells, Dates, Sheet, Table, lines_of, texts_of
from rulec_runtime.recordings.time_column import seconds_in, time_of_parts
from rulec_runtime.recordings.titles import unit_in


def last_before(own: Array, rows: Array, longest: float | None) -> NDArray[np.intp]:
    """Index of the latest of the times `own` at or before each of the times `rows`, both in order,
    s; -1 if there is none, or if it is older than `longest`."""
    at = np.searchsorted(own, rows, side="right") - 1
    if longest is not None and len(own):
        at[rows - own[np.maximum(at, 0)] > longest] = -1
    return np.asarray(at, dtype=np.intp)


def held(
    columns: Mapping[int, Column], time: Cells, form: FileForm, remarks: tuple[str, ...]
) -> tuple[dict[int, Column], tuple[str, ...]]:
    """Columns whose empty cells take the reading above them while it holds; a word ends it."""
    seconds, found = seconds_in(time, form), {}
    for index, column in columns.items():
        values = column.numbers()
        rows = rows_written(values, column, seconds)
        if len(rows):
            at = last_before(seconds[rows], seconds, form.hold_for)
            values = np.where(at >= 0, values[rows[np.maximum(at, 0)]], np.nan)
        found[index] = replace(column, parts=Growing())
        found[index].parts.append(values)
    return found, (*remarks, remark_on_hold(form))


def remark_on_hold(form: FileForm) -> str:
    """The remark on readings that hold."""
    most = "" if form.hold_for is None else f", for {form.hold_for:g} s at most"
    return f"a reading holds until the next one of its signal{most}, as the column map says"


def rows_written(values: Array, column: Column, seconds: Array) -> NDArray[np.intp]:
    """Rows of a column with a number or a word, in order of time."""
    there = np.isfinite(values)
    there[[*(column.placed or ())]] = True
    rows = np.flatnonzero(there & np.isfinite(seconds))
    return rows[np.argsort(seconds[rows], kind="stable")]


def written_on_change(times: Array, rows: int) -> bool:
    """Whether times, in order, s, belong to a reading written on change: few compared with `rows`,
    and at irregular intervals."""
    if len(times) > limits.SHARE_ON_CHANGE * rows:
        return False
    steps = np.diff(times)
    if len(steps) < 2:
        return rows > limits.ROWS_ON_CHANGE
    usual = np.abs(steps - np.median(steps)) <= 0.5 * np.median(steps)
    return float(usual.mean()) < limits.SHARE_REGULAR


@dataclass(frozen=True)
class Readings:
    """Readings of one tag in order of time: `rows` of the file, times `at`, s, and the `numbers`,
    NaN for a word or a bad quality."""

    rows: NDArray[np.intp]
    at: Array
    numbers: Array


@dataclass(frozen=True)
class LongTable:
    """Readings of all tags; `times` are those of all rows in the form of the file, `words` stand in
    place of a number by row. `untimed` counts readings without a time; `left_out` are the number of
    rows with a wrong number of cells, and the first of them."""

    path: Path
    tags: tuple[str, ...]
    readings: tuple[Readings, ...]
    times: Cells
    words: Mapping[int, str]
    form: FileForm
    untimed: int
    left_out: tuple[int, int]
    decimals: set[str]

    def read(self, raw: Sequence[int], numbers: Sequence[int], _: FileForm = INFERRED) -> Table:
        form = self.form
        found = {index - 1: self.readings[index - 1] for index in (*numbers, *raw) if index}
        most = max(found, key=lambda k: len(found[k].at), default=0)
        base = self._rows(found, most)
        times = _taken(self.times, base)
        at = seconds_in(times, form)
        if form.hold == "last":
            placed = {k: last_before(r.at, at, form.hold_for) for k, r in found.items()}
        else:
            placed = {k: _nearest(at, r.at) for k, r in found.items()}
        columns = {k: self._column(k, placed[k]) for k in found}
        return Table(
            raw=tuple(self._texts(columns[i - 1]) if i else times for i in raw),
            columns=tuple(columns[index - 1] for index in numbers),
            left_out=self.left_out[0],
            first_left_out=self.left_out[1],
            remarks=tuple(self._moved(most, at, found, placed)),
        )

    def _rows(self, found: Mapping[int, Readings], most: int) -> NDArray[np.intp]:
        """Rows of the file that give the times of the table: those of the tag with the most
        readings or, if readings hold, of all tags, unless they are closer than those of this one.

        Raises `Unclear` if readings seem to hold, but no column map says so.
        """
        base, form = found[most] if found else self.readings[0], self.form
        if form.hold == "last":
            rows = np.concatenate([r.rows for r in found.values()])
            at = np.concatenate([r.at for r in found.values()])
            order = np.argsort(at, kind="stable")
            steps = np.diff(base.at)
            least = 0.5 * float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
            return rows[order[_apart(at[order], least)]]
        for k, one in found.items():
            count = len(one.at)
            if not form.hold and count and written_on_change(one.at, len(base.at)):
                times = plural(count, "time", "times")
                raise Unclear(
                    f"{self.path}: readings of '{self.tags[k]}' come at {times} where those of "
                    f"'{self.tags[most]}' come at {len(base.at)}, as where a value is written when "
                    "it changes; say in the column map 'file: {hold: last}' if a reading holds "
                    "until the next one, else 'file: {hold: never}'",
                    [{"hold": "last"}, {"hold": "never"}],
                    likely=True,
                )
        return base.rows

    def _column(self, k: int, indexes: NDArray[np.intp]) -> Column:
        """The reading of a tag at each index, NaN for -1."""
        own, column = self.readings[k], Column(self.tags[k], decimals=self.decimals, placed={})
        numbers = np.full(len(indexes), np.nan)
        there = np.flatnonzero(indexes >= 0)
        numbers[there] = own.numbers[indexes[there]]
        column.parts.append(numbers)
        if self.words:
            for row, source in zip(there.tolist(), own.rows[indexes[there]].tolist(), strict=True):
                if (word := self.words.get(source)) is not None:
                    column.say(row, word)
        return column

    @staticmethod
    def _texts(column: Column) -> list[str]:
        texts, words = texts_of(column.numbers()), column.placed or {}
        return [words.get(row, text) for row, text in enumerate(texts)]

    def _moved(
        self,
        most: int,
        at: Array,
        found: Mapping[int, Readings],
        placed: Mapping[int, NDArray[np.intp]],
    ) -> Iterator[str]:
        """Remarks on readings whose time has no row."""
        if self.untimed:
            count = plural(self.untimed, "reading has", "readings have")
            yield f"{count} no usable time; left out"
        if self.form.hold == "last":
            yield remark_on_hold(self.form)
            return
        moved, lost, largest = 0, 0, 0.0
        for k, own in found.items():
            there = placed[k] >= 0
            lost += len(own.at) - int(there.sum())
            away = np.abs(at[there] - own.at[placed[k][there]])
            moved += int((away > 0).sum())
            largest = max(largest, float(away.max(initial=0.0)))
        name = self.tags[most]
        if moved:
            yield (
                f"{plural(moved, 'reading was', 'readings were')} taken at other times than those "
                f"of '{name}'; each stands in the row nearest to it, at most {largest:.6g} away"
            )
        if lost:
            yield (
                f"{plural(lost, 'reading has', 'readings have')} no row of '{name}' near, or share "
                "one with another; left out"
            )


def long_sheet(path: Path, sheet: Sheet, roles: ColumnRoles, form: FileForm) -> Sheet:
    """A table with a column per tag, made from a long one."""
    beside = [i for i in (roles.quality, roles.unit) if i >= 0]
    asked = [*roles.time, roles.tag, *beside]
    table = sheet.read(asked, [roles.value], replace(form, layout="long"))
    cells = dict(zip(asked, table.raw, strict=True))
    times, notes = time_of_parts(path, [cells[i] for i in roles.time], form)
    names = [text.strip() for text in texts_of(cells[roles.tag])]
    tags = {name: k for k, name in enumerate(dict.fromkeys(names))}
    number = np.array([tags[name] for name in names], dtype=np.intp)
    (column,) = table.columns
    values, words = column.numbers(), dict(column.placed or {})
    if roles.quality >= 0:
        title, texts = sheet.titles[roles.quality], texts_of(cells[roles.quality])
        good = good_of(path, title, set(texts), form)
        notes = (*notes, *codes_remark(path, title, set(texts), form))
        words |= {k: as_word(text) for k, text in enumerate(texts) if not good[text]}
    values[[*words]] = np.nan
    units = texts_of(cells[roles.unit]) if roles.unit >= 0 else []
    seconds = seconds_in(times, form)
    dated = np.flatnonzero(np.isfinite(seconds))
    order = dated[np.lexsort((seconds[dated], number[dated]))]
    edges = np.searchsorted(number[order], np.arange(len(tags) + 1))
    parts = [order[low:high] for low, high in pairwise(edges.tolist())]
    readings = tuple(Readings(rows, seconds[rows], values[rows]) for rows in parts)
    untimed = int(np.isfinite(values).sum() - np.isfinite(values[dated]).sum())
    left_out = table.left_out, table.first_left_out
    long = LongTable(
        path, tuple(tags), readings, times, words, form, untimed, left_out, column.decimals
    )
    count = f"a reading a row; {plural(len(tags), 'tag', 'tags')} became columns"
    others = {*range(len(sheet.titles))} - {*asked, roles.value}
    if others:
        unread = ", ".join(f"'{sheet.titles[i].strip()}'" for i in sorted(others))
        count += f"; not read: {unread}"
    return replace(
        sheet,
        titles=(sheet.titles[roles.time[0]], *tags),
        units=(sheet.units[roles.time[0]], *_units(path, tuple(tags), number, units)),
        read=long.read,
        lines=lambda: lines_of(long.read, len(long.tags) + 1),
        rows=None,
        remarks=(*sheet.remarks, *table.remarks, count, *notes),
    )


def _units(
    path: Path, tags: Sequence[str], number: NDArray[np.intp], units: Sequence[str]
) -> list[str]:
    """The unit of each tag, empty if none is given."""
    found = [""] * len(tags)
    pairs = dict.fromkeys(zip(number.tolist(), units, strict=True)) if units else {}
    for k, cell in pairs:
        text = unit_in(cell)
        if text and found[k] and found[k] != text:
            raise RecordingRefused(
                f"{path}: readings of '{tags[k]}' are in '{found[k]}' and in '{text}'; write them "
                "in one unit"
            )
        found[k] = found[k] or text
    return found


def _apart(at: Array, least: float) -> NDArray[np.intp]:
    """Positions of times, in order, each later than the one before, by `least` or more."""
    rows, last = [], -np.inf
    for row, time in enumerate(at.tolist()):
        if time > last and time - last >= least:
            rows.append(row)
            last = time
    return np.array(rows, dtype=np.intp)


def _nearest(base: Array, own: Array) -> NDArray[np.intp]:
    """Index of the reading in each row, -1 for none: a reading goes to the nearest time of `base`,
    if within half the usual distance; of several in one row the nearest stays."""
    found = np.full(len(base), -1, dtype=np.intp)
    if not len(base) or not len(own):
        return found
    near = nearest(base, own)
    away = np.round(np.abs(base[near] - own) * 1e6) / 1e6
    taken = np.where(away <= 0.5 * interval_of(base, 0.0), near, -1)
    order = np.lexsort((away, taken))
    again = np.concatenate([[False], np.diff(taken[order]) == 0])
    taken[order[again]] = -1
    there = taken >= 0
    found[taken[there]] = np.flatnonzero(there)
    return found


def _taken(times: Cells, rows: NDArray[np.intp]) -> Cells:
    if isinstance(times, Dates):
        return Dates(times.seconds[rows], times.zones[rows])
    return np.asarray(times, dtype=float)[rows]
