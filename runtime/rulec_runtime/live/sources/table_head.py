"""The lines of a growing table, and its head: its titles, and the row of units below them."""

from collections.abc import Collection
from dataclasses import dataclass

from rulec_runtime.live.sources import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, cells_of
from rulec_runtime.recordings.titles import TitleLine, TitleSearch, rejoined, units_below

_MARKS = ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))


class LineCutter:
    """Lines of UTF-8, UTF-16 with byte order mark, or else Latin-1, which decodes every byte.

    `offset` is the end of the last complete line, in bytes. Of a line that is too long only the end
    is kept: it has another number of cells than a row.
    """

    def __init__(self, encoding: str = "", offset: int = 0) -> None:
        self.encoding, self.offset = encoding, offset
        self._pending = b""

    @property
    def waiting(self) -> int:
        """Bytes of the current partial line."""
        return len(self._pending)

    def feed(self, data: bytes) -> list[str]:
        """The lines completed by these bytes, without their ends."""
        data = self._pending + data
        if not self.encoding:
            data = self._begun(data)
        end = self._end_of_lines(data)
        self.offset += end
        whole, self._pending = data[:end], data[end:]
        if len(self._pending) > limits.LONGEST_LINE:
            dropped = len(self._pending) // self._width * self._width
            self.offset, self._pending = self.offset + dropped, self._pending[dropped:]
        return [line.removesuffix("\r") for line in self._decoded(whole).split("\n")[:-1]]

    def rest(self) -> list[str]:
        """The last line, if the source has ended without ending it."""
        rest, self._pending = self._pending, b""
        self.offset += len(rest)
        return [self._decoded(rest)] if rest else []

    @property
    def _width(self) -> int:
        return 2 if self.encoding.startswith("utf-16") else 1

    def _begun(self, data: bytes) -> bytes:
        """The bytes after the byte order mark; the encoding stays unknown while a mark may come."""
        if len(data) < max(len(mark) for mark, _ in _MARKS) and b"\n" not in data:
            return data
        for mark, encoding in _MARKS:
            if data.startswith(mark):
                self.encoding = encoding
                self.offset += len(mark)
                return data[len(mark) :]
        self.encoding = "utf-8"
        return data

    def _end_of_lines(self, data: bytes) -> int:
        if self._width == 1:
            return data.rfind(b"\n") + 1
        sign, end = "\n".encode(self.encoding), len(data)
        while (found := data.rfind(sign, 0, end)) >= 0:
            if found % 2 == 0:
                return found + 2
            end = found + 1
        return 0

    def _decoded(self, data: bytes) -> str:
        try:
            return data.decode(self.encoding or "utf-8")
        except UnicodeDecodeError:
            return data.decode("latin-1" if self._width == 1 else self.encoding, "replace")


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
        if "\0" in line and not self._search.in_sight:
            raise RecordingRefused(f"{self._name}: this is a binary file; a CSV file is read here")
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
