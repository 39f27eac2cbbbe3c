"""Which line of a text holds the titles of its table, found as lines come: in a file that is whole,
and in one that a logger writes on."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from rulec_runtime import limits
from rulec_runtime.recordings.csv_table import before_header, cells_of, separator_of
from rulec_runtime.recordings.titles import are_titles, are_values, is_time


@dataclass(frozen=True)
class TitleLine:
    """The `number` of the line of titles, from 0, its `separator`, and how many lines `above` it
    are no part of the table."""

    number: int
    separator: str
    above: int


@dataclass(frozen=True)
class _Line:
    """A line that may hold titles."""

    number: int
    separator: str
    cells: list[str]
    likely: bool


class TitleSearch:
    """The titles are the first line that looks so, with a row below it that is as wide. Where no
    line looks like titles, the first one holds them."""

    def __init__(self, times: Collection[str]) -> None:
        self._times = times
        self._found: list[_Line] = []
        self._number, self._stated = 0, ""
        self.in_sight = False
        """Whether a line looks like titles, or like a row of numbers."""

    def add(self, line: str) -> TitleLine | None:
        """The titles, as soon as further lines would change nothing."""
        number, self._number = self._number, self._number + 1
        stated, is_header = before_header(line)
        self._stated = stated or self._stated
        if not is_header:
            return None
        separator = self._stated or separator_of(line)
        cells = cells_of(line, separator)
        likely, values = are_titles(cells, self._times), are_values(cells)
        above = self._found[-1] if self._found else None
        self.in_sight = self.in_sight or likely or values
        self._found.append(_Line(number, separator, cells, likely))
        if above and len(cells) >= len(above.cells) and self._holds_titles(above, values):
            return self._as_titles(len(self._found) - 2)
        return self.so_far() if len(self._found) > limits.LINES_ABOVE_TITLES else None

    def so_far(self) -> TitleLine | None:
        """The titles, where no further line comes; None without a line that may hold them."""
        if not self._found:
            return None
        likely = [k for k, line in enumerate(self._found) if line.likely]
        last = len(self._found) - 1
        return self._as_titles(last if last in likely else next(iter(likely), 0))

    def _holds_titles(self, line: _Line, before_values: bool) -> bool:
        """Titles may be numbers, as channels of a logger are, if numbers alone are below them."""
        timed = len(line.cells) > 1 and any(is_time(cell, self._times) for cell in line.cells)
        return line.likely or (before_values and timed)

    def _as_titles(self, k: int) -> TitleLine:
        return TitleLine(self._found[k].number, self._found[k].separator, k)
