"""Lines of a CSV file or of standard input to rows: its header once, then blocks of lines."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources.remarks import Remarks, notice
from rulec_runtime.live.sources.row_clock import RowClock
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import (
    Column,
    before_header,
    is_whole,
    read_cells,
    refuse_words,
    separator_of,
)
from rulec_runtime.recordings.header import Header, Target, assign
from rulec_runtime.recordings.recording import foreign
from rulec_runtime.recordings.recording_file import in_si, largest_reading
from rulec_runtime.recordings.time_column import dates_of, factor_of_time, plain_times


class TableStream:
    """One table, read as far as it has come.

    Dialects, titles, units and times are those of recordings. A line is a row: no cell holds the
    end of a line.
    """

    def __init__(self, path: Path, ruleset: Ruleset, clock: RowClock, remarks: Remarks) -> None:
        self._path, self._ruleset, self._clock, self._remarks = path, ruleset, clock, remarks
        self._separator = ""
        self._width = 0
        self._header: Header | None = None
        self._factor = 1.0
        self._notes: list[str] = []
        self._begun = False
        self._decimals: dict[str, set[str]] = {}

    @property
    def has_header(self) -> bool:
        return self._header is not None

    def resume(self) -> None:
        """Rows of it were read before."""
        self._begun = True

    def feed(self, lines: Sequence[str]) -> list[Rows | Notice]:
        """Rows of further lines, without their ends.

        Raises `RecordingRefused` where the table is none of this plant.
        """
        start = 0
        while self._header is None and start < len(lines):
            self._before(lines[start])
            start += 1
        if self._header is None:
            return []
        cells = [row for line in lines[start:] if any(row := self._cells(line))]
        whole = [row for row in cells if is_whole(row, self._width)]
        found: list[Rows | Notice] = []
        if len(whole) < len(cells):
            found += self._told("cells", self._odd(len(cells) - len(whole)))
        return found + self._rows(self._header, whole) if whole else found

    def _before(self, line: str) -> None:
        """A line up to the header, and the header itself."""
        stated, is_header = before_header(line)
        self._separator = stated or self._separator
        if not is_header:
            return
        self._separator = self._separator or separator_of(line)
        titles = self._cells(line)
        header = Header()
        assign(self._path, titles, self._ruleset, header, self._notes)
        if not self._ruleset.read.intersection(t.signal for t in header.targets):
            raise foreign(str(self._path), self._ruleset)
        self._width = len(titles)
        units = self._ruleset.units
        self._factor = factor_of_time(self._path, header.time_title, header.time_unit, units)
        self._header = header

    def _cells(self, line: str) -> list[str]:
        if '"' not in line:
            return line.split(self._separator)
        try:
            return next(csv.reader([line], delimiter=self._separator), [])
        except csv.Error:
            return [line]

    def _rows(self, header: Header, rows: list[list[str]]) -> list[Rows | Notice]:
        if not self._begun:
            indexes = (header.time, *(t.index for t in header.targets))
            refuse_words(self._path, rows[0], indexes)
        time, kept, found = self._clock.later(self._times([row[header.time] for row in rows]))
        if not kept.any():
            return list(found)
        first = [] if self._begun else self._connected(header, float(time[kept][0]))
        self._begun = True
        values, odd = {}, []
        for target in header.targets:
            cells = [row[target.index] for row in rows]
            numbers, remarks = self._readings(target, cells)
            values[target.signal] = numbers[kept]
            odd += remarks
        return [*first, *odd, *found, Rows(time[kept], values)]

    def _times(self, cells: list[str]) -> Array:
        """Seconds; the first usable cell says whether they are dates."""
        if self._clock.dated is None:
            numbers = plain_times(cells)
            if np.isfinite(numbers).any():
                self._clock.dated = False
                return numbers * self._factor
            dates, _ = dates_of(cells)
            if np.isfinite(dates).any():
                self._clock.dated = True
            return dates
        return dates_of(cells)[0] if self._clock.dated else plain_times(cells) * self._factor

    def _readings(self, target: Target, cells: list[str]) -> tuple[Array, list[Notice]]:
        """Numbers of a column in SI, and what is odd about them."""
        signal = target.signal
        before = self._decimals.get(signal, set())
        column = Column(signal, decimals=set(before))
        read_cells(column, cells, 0, self._separator != ",")
        if len(column.decimals) > 1:
            text = (
                f"{self._name}: {signal} mixes decimal comma and decimal point; it has no reading"
            )
            return np.full(len(cells), np.nan), self._told((signal, "decimals"), text)
        self._decimals[signal] = column.decimals
        most = largest_reading(self._ruleset.signal_by_id[signal])
        values, absurd = in_si(column.numbers(), target, most)
        found = []
        if column.first is not None:
            one, many = f"cell of {signal} is a word", f"cells of {signal} are words"
            text = f"{self._name}: {plural(column.words, one, many)} (the first: "
            text += f"'{column.first[1]}'); there it has no reading"
            found += self._told((signal, "words"), text)
        if absurd.any():
            one, many = f"cell of {signal} is", f"cells of {signal} are"
            text = f"{self._name}: {plural(int(absurd.sum()), one, many)} beyond any sensor; "
            found += self._told((signal, "absurd"), text + "there it has no reading")
        return values, found

    def _connected(self, header: Header, time: float) -> list[Notice]:
        """What is read from here, and what of the plant is not."""
        read = self._ruleset.read
        here = {t.signal for t in header.targets} & read
        missing = [s.id for s in self._ruleset.signals if s.id in read and s.id not in here]
        text = f"{self._name}: {len(here)} of {plural(len(read), 'signal', 'signals')}"
        text += f"; without {', '.join(missing)}" if missing else ""
        text = "; ".join([text, *(note.removeprefix(f"{self._name}: ") for note in self._notes)])
        return [notice("connected", time, text)]

    @property
    def _name(self) -> str:
        return self._path.name

    def _odd(self, rows: int) -> str:
        what = plural(rows, "row has", "rows have")
        return f"{self._name}: {what} another number of cells than the header; left out"

    def _told(self, key: object, text: str) -> list[Notice]:
        return self._remarks.tell("refused", key, self._clock.now, text)
