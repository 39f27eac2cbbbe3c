"""Rows from the lines of a growing CSV file or of standard input: the header once, then blocks of
lines."""

import os
import select
import sys
import time as clocks
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rulec_runtime.contract.file_form import START, FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.limits import SHOWING_ROWS
from rulec_runtime.live.rows import Notice, NoticeKind, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.remarks import Remarks, Silence, notice
from rulec_runtime.live.sources.row_clock import RowClock
from rulec_runtime.live.sources.table_head import LineCutter, TableHead, head_in
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.column_roles import roles_of
from rulec_runtime.recordings.csv_table import (
    UNKNOWN,
    Column,
    Convention,
    RecordingRefused,
    Unclear,
    cells_of,
    is_whole,
    read_cells,
    refuse_words,
)
from rulec_runtime.recordings.dates import ZoneClock
from rulec_runtime.recordings.header import Header, Target, assign, foreign, summed
from rulec_runtime.recordings.limits import FEW_TEXTS
from rulec_runtime.recordings.quality import judged
from rulec_runtime.recordings.recording_file import form_of, readings_of, times_of
from rulec_runtime.recordings.table import Dates
from rulec_runtime.recordings.text_table import conventions
from rulec_runtime.recordings.time_column import TimeReader, factor_of_time, may_be_day, plain_times
from rulec_runtime.recordings.titles import is_time, left_out_above


class TableStream:
    """A growing table.

    Dialects, titles, units and times are those of recordings. A line is a row: no cell contains a
    line break. `known` is how an earlier table was written: a table with the same titles is read in
    the same way where its first rows could be read in several ways.
    """

    def __init__(
        self,
        path: Path,
        ruleset: Ruleset,
        clock: RowClock,
        remarks: Remarks,
        known: Mapping[str, Any],
    ) -> None:
        self._path, self._ruleset, self._clock, self._remarks = path, ruleset, clock, remarks
        self._lines: list[str] = []
        self.head: TableHead | None = None
        self._form = form_of(ruleset)
        self._begun = False
        self._decimals: dict[str, set[str]] = {}
        self._written: dict[int, Convention] = {}
        self._qualities_seen: set[str] = set()
        self._known = known
        self._zone: ZoneClock | None = None
        self._in_utc = False

    def begin(self, head: TableHead) -> None:
        """Read the head. Raises `RecordingRefused` for a table of another plant."""
        notes = list(left_out_above(head.above))
        header = assign(self._path, head.titles, self._ruleset, notes, head.units)
        roles = roles_of(self._path, head.titles, self._form)
        if roles.layout != "wide" or len(roles.time) > 1 or self._form.hold == "last":
            raise RecordingRefused(
                f"{self._path}: watch reads tables with a column per signal and one of times; have "
                "this one written so, or read it with rulec diagnose when it is complete"
            )
        self._qualities = roles.quality_of or {}
        if not self._ruleset.read.intersection(t.signal for t in header.targets):
            raise foreign(str(self._path), self._ruleset)
        title, unit = header.time_title, header.time_unit
        self._factor = factor = self._form.time_factor or factor_of_time(
            self._path, title, unit, self._ruleset.units
        )

        def reader(form: FileForm) -> TimeReader:
            return TimeReader(self._path, form, notes, title, lambda: factor if unit else 0.0)

        self._reader, self._times = reader, reader(self._form)
        if self._known.get("titles") != [*head.titles]:
            self._known = {}
        self._qualities_seen |= {*self._known.get("qualities", ())}
        self._header, self._notes, self.head = header, notes, head

    @property
    def known(self) -> Mapping[str, Any]:
        """How this table is written, or before its first row an earlier one; can be stored as
        JSON."""
        if self.head is None or not self._begun:
            return self._known
        times, stated = self._times, dict[str, Any]()
        if times.counting is not None:
            stated = {"since": times.counting.since, "time_factor": times.counting.factor}
        elif times.order:
            stated = {"dates": times.order}
        elif times.dated is False:
            stated = {"since": START}
        signs = [self._written.get(t.index, UNKNOWN) for t in self._header.targets]
        return {
            "titles": [*self.head.titles],
            "times": stated,
            "signs": [[one.decimal, one.thousands] for one in signs],
            "qualities": sorted(self._qualities_seen),
        }

    def go_on(self, lines: Sequence[str]) -> bool:
        """Continue a table that an earlier process has read; its first lines show how numbers and
        times are written. Returns whether they hold a head. Raises as `begin` does."""
        self._lines = [*lines]
        head, self._lines = self._head(ended=True), []
        if head is None:
            return False
        self.begin(head)
        rows, _ = _rows_in(head, lines[head.end :][:SHOWING_ROWS])
        self._begun = self._clock.begun
        if self._begun and rows:
            self._settle(head, rows)
            self._see_qualities(rows)
            self._times_in([row[self._header.time] for row in rows])
        return True

    def check(self) -> None:
        """Raises `RecordingRefused` if only a head has come so far, and is of another plant."""
        head = None if self.head else self._head(ended=True)
        if head is not None and head.likely:
            TableStream(self._path, self._ruleset, self._clock, self._remarks, {}).begin(head)

    def feed(self, lines: Sequence[str], ended: bool = False) -> list[Rows | Notice]:
        """Rows of further lines, without line ends; the first lines may be the head, which may wait
        for a row unless the table has `ended`. Raises `RecordingRefused` as `begin` does."""
        if self.head is None and (lines or ended):
            self._lines += lines
            lines = []
            if (head := self._head(ended)) and (ended or self._shows_times(head)):
                self.begin(head)
                lines, self._lines = self._lines[head.end :], []
        if self.head is None:
            return []
        rows, odd = _rows_in(self.head, lines)
        found = self._rows(self.head, rows) if rows else []
        if odd:
            what = plural(odd, "row has", "rows have")
            text = f"{self._name}: {what} another number of cells than the header; left out"
            found += self._refused("cells", text)
        return found

    def _shows_times(self, head: TableHead) -> bool:
        """Whether the rows so far show what times count: one number may be days or seconds."""
        rows, _ = _rows_in(head, self._lines[head.end :])
        if len(rows) != 1:
            return len(rows) > 1
        named, times = zip(head.titles, rows[0], strict=False), times_of(self._ruleset)
        stamps = plain_times([cell for title, cell in named if is_time(title, times)])
        return not any(map(may_be_day, stamps))

    def _head(self, ended: bool) -> TableHead | None:
        return head_in(str(self._path), self._lines, times_of(self._ruleset), ended)

    def _rows(self, head: TableHead, rows: list[list[str]]) -> list[Rows | Notice]:
        header = self._header
        if not self._begun:
            refuse_words(self._path, rows[0], (header.time, *(t.index for t in header.targets)))
            self._settle(head, rows)
        time, newer, found = self._clock.later(self._seconds([row[header.time] for row in rows]))
        found += self._impossible()
        self._see_qualities(rows)
        if not newer.any():
            return list(found)
        first = [] if self._begun else self._connected(header, float(time[newer][0]))
        self._begun = True
        parts, odd = list[Array](), list[Notice]()
        for target in header.targets:
            numbers, remarks = self._readings(head, target, rows)
            parts.append(numbers[newer])
            odd += remarks
        return [*first, *odd, *found, Rows(time[newer], summed(header.targets, parts))]

    def _settle(self, head: TableHead, rows: list[list[str]]) -> None:
        """How each column writes numbers, by the first rows."""
        indexes = [target.index for target in self._header.targets]
        try:
            written = conventions(
                self._path, head.titles, rows, indexes, head.separator, self._form
            )
        except Unclear:
            if not self._known:
                raise
            written = [Convention(*signs) for signs in self._known["signs"]]
        self._written = dict(zip(indexes, written, strict=True))

    def _see_qualities(self, rows: list[list[str]]) -> None:
        """Remember all qualities: those of a few rows may not show their standard."""
        if self._qualities and len(self._qualities_seen) < FEW_TEXTS:
            columns = {*self._qualities.values()}
            self._qualities_seen |= {row[i] for row in rows for i in columns}

    def _seconds(self, cells: list[str]) -> Array:
        """Seconds, since 1970 for dates; one without a zone is in the zone of the column map."""
        times = self._times_in(cells)
        if self._times.dated is not None:
            self._clock.dated = self._times.dated
        if not isinstance(times, Dates):
            return times * self._factor
        dates, zones, name = times.seconds, times.zones, self._ruleset.time_zone
        self._in_utc = not name and bool(np.isfinite(zones).any())
        if not name or not (np.isfinite(dates) & np.isnan(zones)).any():
            return dates
        if self._zone is None:
            self._zone = ZoneClock(self._path, name)
            if self._clock.begun:
                self._zone.resume(self._clock.last)
        return self._zone.read(dates, zones)[0]

    def _times_in(self, cells: list[str]) -> Array | Dates:
        """Times as their reader gives them."""
        try:
            return self._times.read(cells)
        except Unclear:
            if not self._known:
                raise
            self._times = self._reader(replace(self._form, **self._known["times"]))
            return self._times.read(cells)

    def _impossible(self) -> list[Notice]:
        """A notice of dates in an hour that the zone skips."""
        if self._zone is None or not self._zone.never:
            return []
        text = f"{self._name}: {self._zone.left_out()}"
        self._zone.never = 0
        return self._remarks.tell("clock", "zone", self._clock.now, text)

    def _readings(
        self, head: TableHead, target: Target, rows: list[list[str]]
    ) -> tuple[Array, list[Notice]]:
        """Numbers of a column in SI, and notices about them."""
        signal, cells = target.signal, [row[target.index] for row in rows]
        before = self._decimals.get(signal, set())
        written = self._written.get(target.index, UNKNOWN)
        column = Column(signal, decimals=set(before), written=written)
        read_cells(column, cells, 0, head.separator != ",")
        if target.index in self._qualities:
            at = self._qualities[target.index]
            texts = [row[at] for row in rows]
            every = {*self._qualities_seen, *texts}
            column = judged(self._path, column, head.titles[at], texts, every, self._form)
        if len(column.decimals) > 1:
            text = (
                f"{self._name}: {signal} mixes decimal comma and decimal point; it has no reading"
            )
            return np.full(len(cells), np.nan), self._refused((signal, "decimals"), text)
        self._decimals[signal] = column.decimals
        values, remarks = readings_of(column, target, self._ruleset, placed=False)
        found = list[Notice]()
        for about, text in remarks:
            if about != "missing":  # the column map expects those
                found += self._refused((signal, about), f"{self._name}: {text}")
        return values, found

    def _connected(self, header: Header, time: float) -> list[Notice]:
        """A notice of the signals that are read, and of those that are missing."""
        read = self._ruleset.read
        here = {t.signal for t in header.targets} & read
        missing = [s.id for s in self._ruleset.signals if s.id in read and s.id not in here]
        text = f"{self._name}: {len(here)} of {plural(len(read), 'signal', 'signals')}"
        text += f"; without {', '.join(missing)}" if missing else ""
        text += "; times in UTC" if self._in_utc else ""
        text = "; ".join([text, *(note.removeprefix(f"{self._name}: ") for note in self._notes)])
        return [notice("connected", time, text)]

    @property
    def _name(self) -> str:
        return self._path.name

    def _refused(self, key: object, text: str) -> list[Notice]:
        return self._remarks.tell("refused", key, self._clock.now, text)


def _rows_in(head: TableHead, lines: Sequence[str]) -> tuple[list[list[str]], int]:
    """Rows with all cells of the titles, and the number of others; a logger that starts again may
    repeat its titles."""
    named = [*head.titles]
    rows = [row for line in lines if any(row := cells_of(line, head.separator)) and row != named]
    whole = [row for row in rows if is_whole(row, len(head.titles))]
    return whole, len(rows) - len(whole)


class TextSource:
    """Base of growing files and pipes: rows from lines, and silence."""

    def __init__(self, path: Path, ruleset: Ruleset) -> None:
        self._path, self._ruleset = path, ruleset
        self._remarks = Remarks()
        self._clock = RowClock(path.name, self._remarks, ruleset.time_zone)
        self._silence = Silence(limits.STALE)
        self._cutter, self._table = LineCutter(), self._new_table({})
        self.ended = False

    @property
    def dated(self) -> bool:
        """Known from the first rows on."""
        return bool(self._clock.dated)

    def _new_table(self, known: Mapping[str, Any]) -> TableStream:
        return TableStream(self._path, self._ruleset, self._clock, self._remarks, known)

    def _notice(self, kind: NoticeKind, text: str, *, still: bool = False) -> Notice:
        return notice(kind, self._clock.now, f"{self._path.name}{text}", still=still)

    def _refusal(self, why: RecordingRefused) -> Notice:
        return notice("refused", self._clock.now, str(why))

    def _heard(
        self, found: Sequence[Rows | Notice], back: Sequence[Notice] = ()
    ) -> list[Rows | Notice]:
        """What was found, after a notice that rows come again, by default that silence is over;
        without rows, followed by one that the source is silent."""
        self._silence.seconds = max(limits.STALE, limits.STALE_STEPS * self._clock.step)
        if not any(isinstance(part, Rows) for part in found):
            return [*back, *found, *self._stale()]
        over = [self._notice("connected", ": rows come again")] if self._silence.heard() else []
        return [*(back or over), *found]

    def _stale(self) -> list[Rows | Notice]:
        if not self._silence.begins():
            return []
        text = f": no row for {self._silence.lasts:.0f} s"
        if self._clock.late:
            text = (
                f": rows came, but for {self._silence.lasts:.0f} s none later than "
                f"{self._clock.shown}; was the clock of the logger set back?"
            )
        return [self._notice("stale", text)]


class StandardInput(TextSource):
    """Rows of a pipe until it ends."""

    def __init__(self, ruleset: Ruleset, descriptor: int | None = None) -> None:
        super().__init__(Path("standard input"), ruleset)
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor

    def take(self, seconds: float) -> list[Rows | Notice]:
        until = clocks.monotonic() + seconds
        while not self.ended:
            left = until - clocks.monotonic()
            if not select.select([self._descriptor], [], [], max(0.0, left))[0]:
                return self._stale()
            found = self._heard(self._read(os.read(self._descriptor, limits.PIECE)))
            if found or left <= 0:
                return found
        return []

    def close(self) -> None:
        self.ended = True

    def _read(self, data: bytes) -> list[Rows | Notice]:
        lines = self._cutter.feed(data) if data else self._cutter.rest()
        found: list[Rows | Notice] = []
        try:
            found += self._table.feed(lines, ended=not data)
        except RecordingRefused as refused:
            found.append(self._refusal(refused))
            data = b""
        if not data:
            self.ended = True
            found.append(self._notice("ended", " has ended"))
        return found
