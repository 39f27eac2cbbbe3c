"""The head of a growing table: its titles, and the row of units below them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from rulec_runtime.live.sources import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, cells_of
from rulec_runtime.recordings.titles import TitleLine, TitleSearch, rejoined, units_below


@dataclass(frozen=True)
class TableHead:
    """Lines from `first` to before `end` hold titles and units; `above` counts lines before the
    table. `units` is as long as `titles`, or empty without a row of units."""

    titles: tuple[str, ...]
    units: tuple[str, ...]
    separator: str
    above: int
    first: int
    end: int


class HeadSearch:
    """Finds a head from lines that come one by one. The row below the titles, which may hold units,
    completes it."""

    def __init__(self, name: str, times: Collection[str]) -> None:
        self._name, self._search = name, TitleSearch(times)
        self._titles: TitleLine | None = None
        self._lines: list[str] = []
        self._length = 0

    @property
    def in_sight(self) -> bool:
        """Whether the lines so far look like a table."""
        return self._search.in_sight

    def add(self, line: str) -> TableHead | None:
        """The head once it is complete. Raises `RecordingRefused` if none comes."""
        self._lines.append(line)
        self._length += len(line)
        self._titles = self._titles or self._search.add(line)
        head = self._head(self._titles) if self._titles else None
        if head is None and self._length > limits.LONGEST_LINE:
            raise RecordingRefused(
                f"{self._name}: no header in its first {limits.LONGEST_LINE} bytes"
            )
        return head

    def so_far(self) -> TableHead | None:
        """The head if no further line comes; None without a line that may hold titles."""
        titles = self._titles or self._search.so_far()
        return self._head(titles, ended=True) if titles else None

    def below(self, head: TableHead) -> list[str]:
        """The lines so far below the head."""
        return self._lines[head.end :]

    def _head(self, found: TitleLine, ended: bool = False) -> TableHead | None:
        separator, first = found.separator, found.number
        titles = rejoined(cells_of(self._lines[first], separator), separator)
        below = range(first + 1, len(self._lines))
        rows = ((n, cells_of(self._lines[n], separator)) for n in below)
        number, row = next(((n, row) for n, row in rows if any(row)), (first, None))
        if row is None and not ended:
            return None
        units = units_below(titles, row) if row else None
        end = number + 1 if units else first + 1
        return TableHead(tuple(titles), units or (), separator, found.above, first, end)
