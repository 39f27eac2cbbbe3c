"""Long tables, as historians write them: a row per reading, with tag, time and value.

They become tables with a column per tag. Tags have times of their own: the rows are those of the
tag with the most readings, and a reading stands in the row nearest to its time, within half of the
usual distance of rows. What has no row there is left out, and that is told.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import Column, RecordingRefused, read_cells
from rulec_runtime.recordings.header import parts_of
from rulec_runtime.recordings.table import Cells, Dates, Sheet, Table, texts_of
from rulec_runtime.recordings.time_column import dates_of, plain_times
from rulec_runtime.recordings.titles import is_time, unit_in

TAGS = ("tag", "tagname", "tag name", "point", "pointname", "variable", "name", "node", "nodeid")
VALUES = ("value", "wert", "val")
QUALITIES = ("quality", "status", "statuscode", "status code", "confidence")
UNITS = ("unit", "units", "einheit", "uom")
GOOD = ("good", "ok", "valid", "true")

_MICROSECONDS = 1e6


@dataclass(frozen=True)
class LongTable:
    """Readings of all tags.

    `tag` is the number of a tag in `tags`, shape (n,), `seconds` numbers by which times can be
    compared, shape (n,), `values` text of the readings, or of why there is none.
    """

    tags: tuple[str, ...]
    tag: NDArray[np.intp]
    times: Cells
    seconds: Array
    values: Sequence[str]
    comma: bool

    def read(self, kept: Sequence[int], numbers: Sequence[int]) -> Table:
        wanted = [index - 1 for index in numbers if index]
        rows = {k: self._rows_of(k) for k in {*wanted, *(index - 1 for index in kept if index)}}
        base = max(rows.values(), key=len, default=self._rows_of(0))
        placed = {k: _nearest(self.seconds[base], self.seconds[own]) for k, own in rows.items()}
        cells = {k: _put(len(base), placed[k], [self.values[i] for i in own])
                 for k, own in rows.items()}  # fmt: skip
        columns = []
        for index in numbers:
            column = Column("time" if not index else self.tags[index - 1])
            read_cells(column, cells[index - 1], 0, self.comma)
            columns.append(column)
        return Table(
            kept=tuple(cells[i - 1] if i else _taken(self.times, base) for i in kept),
            columns=tuple(columns),
            remarks=tuple(self._moved(base, rows, placed)),
        )

    def lines(self) -> Iterator[list[str]]:
        table = self.read(range(len(self.tags) + 1), ())
        return (list(row) for row in zip(*(texts_of(c) for c in table.kept), strict=True))

    def _rows_of(self, number: int) -> NDArray[np.intp]:
        """Readings of a tag that have a time, in order of it."""
        own = np.flatnonzero((self.tag == number) & np.isfinite(self.seconds))
        return own[np.argsort(self.seconds[own], kind="stable")]

    def _moved(
        self,
        base: NDArray[np.intp],
        rows: dict[int, NDArray[np.intp]],
        placed: dict[int, NDArray[np.intp]],
    ) -> Iterator[str]:
        """Remarks on readings that have no row of their own time."""
        untimed = int((~np.isfinite(self.seconds)).sum())
        if untimed:
            yield f"{plural(untimed, 'reading has', 'readings have')} no usable time; left out"
        moved, lost, largest = 0, 0, 0.0
        for k, own in rows.items():
            there = placed[k] >= 0
            lost += int((~there).sum())
            away = np.abs(self.seconds[base[placed[k][there]]] - self.seconds[own[there]])
            moved += int((away > 0).sum())
            largest = max(largest, float(away.max(initial=0.0)))
        name = self.tags[int(self.tag[base[0]])] if len(base) else ""
        if moved:
            yield (
                f"{plural(moved, 'reading was', 'readings were')} taken at other times than those "
                f"of '{name}'; each stands in the row nearest to it, at most {largest:g} away"
            )
        if lost:
            yield (
                f"{plural(lost, 'reading has', 'readings have')} no row of '{name}' near, or share "
                "one with another; left out"
            )


def wide(path: Path, sheet: Sheet, times: Collection[str]) -> Sheet:
    """A table with a column per tag of a long one; any other as it is."""
    names = [parts_of(title.strip())[0].lower() for title in sheet.titles]
    tag, value = _first(names, TAGS), _first(names, VALUES)
    time = next((i for i, title in enumerate(sheet.titles) if is_time(title, times)), -1)
    if len(names) > 8 or min(tag, value, time) < 0:
        return sheet
    quality, unit = _first(names, QUALITIES), _first(names, UNITS)
    asked = [tag, time, value, *(i for i in (quality, unit) if i >= 0)]
    table = sheet.read(asked, ())
    told = dict(zip(asked, table.kept, strict=True))
    stated = [text.strip() for text in texts_of(told[tag])]
    tags = {name: k for k, name in enumerate(dict.fromkeys(stated))}
    number = np.array([tags[name] for name in stated], dtype=np.intp)
    values = texts_of(told[value])
    if quality >= 0:
        values = _judged(path, values, texts_of(told[quality]))
    units = _units(path, tuple(tags), number, texts_of(told[unit]) if unit >= 0 else [])
    long = LongTable(
        tuple(tags), number, told[time], _comparable(told[time]), values, sheet.separator != ","
    )
    count = f"a reading a row; {plural(len(tags), 'tag', 'tags')} became columns"
    return Sheet(
        name=sheet.name,
        titles=(sheet.titles[time], *tags),
        units=(sheet.units[time], *units),
        read=long.read,
        lines=long.lines,
        separator=sheet.separator,
        remarks=(*sheet.remarks, *table.remarks, count),
    )


def _first(names: Sequence[str], wanted: Collection[str]) -> int:
    return next((i for i, name in enumerate(names) if name in wanted), -1)


def _comparable(times: Cells) -> Array:
    """Times as numbers, NaN where there is none."""
    if isinstance(times, Dates):
        return times.seconds
    if isinstance(times, np.ndarray):
        return times
    numbers = plain_times(times)
    return numbers if np.isfinite(numbers).any() else dates_of(times)[0]


def _judged(path: Path, values: Sequence[str], qualities: Sequence[str]) -> list[str]:
    """Values, with the quality in place of those that are not good."""
    verdict = {text: _is_good(text) for text in set(qualities)}
    if set(verdict) == {"0"}:
        raise RecordingRefused(
            f"{path}: every quality is 0, which is good in OPC UA and bad in OPC DA; write Good or "
            "Bad into the column, or take it out"
        )
    found = []
    for value, text in zip(values, qualities, strict=True):
        name = text.strip() if text.strip()[:1].isalpha() else f"quality {text.strip()}"
        found.append(value if verdict[text] else name)
    return found


def _is_good(text: str) -> bool:
    """Whether a quality is a word that says so, or a number from 192 to 255."""
    try:
        return limits.GOOD_QUALITY <= float(text) <= 255
    except ValueError:
        return text.strip().lower() in ("", *GOOD)


def _units(
    path: Path, tags: Sequence[str], number: NDArray[np.intp], units: Sequence[str]
) -> list[str]:
    """The unit of each tag, empty where none is told."""
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


def _nearest(base: Array, own: Array) -> NDArray[np.intp]:
    """For each time the row of `base` (in order) that is nearest, -1 where none is within half of
    the usual distance, and where a nearer one took it."""
    if not len(base):
        return np.full(len(own), -1, dtype=np.intp)
    behind = np.clip(np.searchsorted(base, own), 1, max(len(base) - 1, 1))
    before, behind = np.maximum(behind - 1, 0), np.minimum(behind, len(base) - 1)
    near = np.where(own - base[before] <= base[behind] - own, before, behind)
    usual = float(np.median(np.diff(base))) if len(base) > 1 else 0.0
    away = np.abs(base[near] - own)
    away = np.round(away * _MICROSECONDS) / _MICROSECONDS
    taken = np.where(away <= 0.5 * usual, near, -1)
    order = np.lexsort((away, taken))
    again = np.concatenate([[False], np.diff(taken[order]) == 0])
    taken[order[again]] = -1
    return taken


def _put(rows: int, places: NDArray[np.intp], cells: Sequence[str]) -> list[str]:
    found = [""] * rows
    for place, cell in zip(places.tolist(), cells, strict=True):
        if place >= 0:
            found[place] = cell
    return found


def _taken(times: Cells, rows: NDArray[np.intp]) -> Cells:
    if isinstance(times, Dates):
        return Dates(times.seconds[rows], times.zones[rows])
    if isinstance(times, np.ndarray):
        return times[rows]
    return [times[i] for i in rows.tolist()]
