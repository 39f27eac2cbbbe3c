"""Cut bytes that come piece by piece into lines; a partial line waits for its end."""

from __future__ import annotations

from rulec_runtime.live.sources import limits

_MARKS = ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))


class LineCutter:
    """Lines of UTF-8, UTF-16 with byte order mark, or else Latin-1, which decodes every byte.

    `offset` is the end of the last complete line, in bytes; `too_long` counts lines dropped for
    their length.
    """

    def __init__(self, encoding: str = "", offset: int = 0) -> None:
        self.encoding, self.offset, self.too_long = encoding, offset, 0
        self._pending, self._dropped = b"", 0

    @property
    def waiting(self) -> int:
        """Bytes of the current partial line."""
        return len(self._pending) + self._dropped

    def feed(self, data: bytes) -> list[str]:
        """The lines completed by these bytes, without their ends."""
        data = self._pending + data
        if not self.encoding:
            data = self._begun(data)
        end = self._end_of_lines(data)
        whole, self._pending = data[:end], data[end:]
        lines = self._cut(whole) if whole else []
        if len(self._pending) > limits.LONGEST_LINE:
            odd = len(self._pending) % self._width
            self._dropped += len(self._pending) - odd
            self._pending = self._pending[len(self._pending) - odd :]
        return lines

    def rest(self) -> list[str]:
        """The last line, if the source has ended without ending it."""
        rest, self._pending = self._pending, b""
        if self._dropped:
            self.offset += self._dropped + len(rest)
            self._dropped, self.too_long = 0, self.too_long + 1
            return []
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

    def _cut(self, whole: bytes) -> list[str]:
        self.offset += len(whole) + self._dropped
        lines = self._decoded(whole).split("\n")[:-1]
        if self._dropped:
            lines, self._dropped = lines[1:], 0
            self.too_long += 1
        kept = [line.removesuffix("\r") for line in lines if len(line) <= limits.LONGEST_LINE]
        self.too_long += len(lines) - len(kept)
        return kept

    def _decoded(self, data: bytes) -> str:
        try:
            return data.decode(self.encoding or "utf-8")
        except UnicodeDecodeError:
            return data.decode("latin-1" if self._width == 1 else self.encoding, "replace")
