"""The lines of a growing table, and its head: its titles, and the row of units below them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from rulec_runtime.live.sources import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, cells_of
from rulec_runtime.recordings.formats import other_than_csv
from rulec_runtime.recordings.titles import rejoined, title_line, units_below

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
    """Titles and units; rows begin at line `end`, and `above` counts lines before the table.

    `units` is as long as `titles`, or empty without a row of units. It is `likely` if a line looks
    like titles, or like a row of numbers.
    """

    titles: tuple[str, ...]
    units: tuple[str, ...]
    separator: str
    above: int
    end: int
    likely: bool


def head_in(
    name: str, lines: Sequence[str], times: Collection[str], ended: bool
) -> TableHead | None:
    """The head of a table that begins with these lines. The row below the titles, which may hold
    units, completes it, unless the table has `ended`.

    None while it is incomplete. Raises `RecordingRefused` if none comes.
    """
    other = other_than_csv(lines[0].encode("utf-8", "replace")) if lines else None
    if other is not None:
        raise RecordingRefused(
            f"{name}: this is {other.name}, not plain CSV; read it with rulec diagnose when it is "
            "complete"
        )
    found = title_line(lines, times, ended)
    number = found.number if found else len(lines)
    if any("\0" in line for line in lines[: number + 1]):
        raise RecordingRefused(f"{name}: this is a binary file; a CSV file is read here")
    if found is not None:
        separator = found.separator
        titles = rejoined(cells_of(lines[number], separator), separator)
        below = ((n, cells_of(lines[n], separator)) for n in range(number + 1, len(lines)))
        end, row = next(((n + 1, row) for n, row in below if any(row)), (number + 1, None))
        if row is not None or ended:
            units = units_below(titles, row) if row else None
            end = end if units else number + 1
            above, likely = found.above, found.likely
            return TableHead(tuple(titles), units or (), separator, above, end, likely)
    if sum(map(len, lines)) > limits.LONGEST_LINE:
        raise RecordingRefused(f"{name}: no header in its first {limits.LONGEST_LINE} bytes")
    return None
