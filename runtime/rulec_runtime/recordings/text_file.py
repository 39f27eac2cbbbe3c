"""Text of a file, packed or not, in any encoding: readable repeatedly, and never loaded at once."""

import codecs
import gzip
import io
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, refuse_bomb

_ANY = "latin-1"
"""An encoding that accepts every byte."""


class _Reader(io.RawIOBase):
    """A file read from its beginning; several readers are independent of each other."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._place = file, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: object) -> int:
        view = memoryview(buffer)  # type: ignore[arg-type]
        self._file.seek(self._place)
        found = self._file.read(len(view))
        view[: len(found)] = found
        self._place += len(found)
        return len(found)


@dataclass(frozen=True)
class TextFile:
    """Text in an encoding."""

    file: BinaryIO
    packed: bool
    encoding: str

    def opened(self) -> io.TextIOWrapper:
        """The text from its beginning, with its line ends unchanged."""
        stream = _unpacked(self.file, self.packed)
        return io.TextIOWrapper(stream, self.encoding, "replace", newline="")


def text_file(file: BinaryIO, path: Path) -> TextFile:
    """Text in UTF-8 or in UTF-16 with a byte order mark, else in Latin-1, which accepts every byte.
    Raises `RecordingRefused` if the file cannot be read or is binary."""
    file.seek(0)
    packed = file.read(2) == b"\x1f\x8b"
    begin = next(_pieces(file, packed, path), b"")
    wide = begin[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    decoder = codecs.getincrementaldecoder("utf-16" if wide else "utf-8")()
    encoding, holds_zero, zero_bytes = "utf-16" if wide else "utf-8-sig", False, False
    open_line = 0
    for piece in _pieces(file, packed, path):
        zero_bytes = zero_bytes or b"\0" in piece
        encoding, zero = _decoded(decoder, piece, encoding, wide)
        holds_zero = holds_zero or zero
        if holds_zero or (zero_bytes and not wide):
            break  # a binary file may be long
        end = max(piece.rfind(b"\n"), piece.rfind(b"\r"))
        open_line = open_line + len(piece) if end < 0 else len(piece) - end
        if open_line > limits.LONGEST_LINE:
            raise RecordingRefused(
                f"{path}: a line of it has more than {limits.LONGEST_LINE >> 20} MB, as no "
                "recording has; export it again"
            )
    encoding, zero = _decoded(decoder, b"", encoding, wide, final=True)
    if zero_bytes if encoding == _ANY or not wide else holds_zero or zero:
        raise RecordingRefused(f"{path}: this is a binary file; export the recording as CSV")
    return TextFile(file, packed, encoding)


def _decoded(
    decoder: codecs.IncrementalDecoder, piece: bytes, encoding: str, wide: bool, final: bool = False
) -> tuple[str, bool]:
    """The encoding that is still possible, and whether a wide character is zero."""
    if encoding == _ANY:
        return encoding, False
    try:
        return encoding, "\0" in decoder.decode(piece, final) and wide
    except UnicodeDecodeError:
        return _ANY, False


def _pieces(file: BinaryIO, packed: bool, path: Path) -> Iterator[bytes]:
    """Bytes piece by piece, so that a small packed file cannot fill the memory."""
    total, size = 0, file.seek(0, os.SEEK_END)
    stream = _unpacked(file, packed)
    try:
        while piece := stream.read(limits.PIECE):
            total += len(piece)
            if packed:
                refuse_bomb(path, total, size)
            yield piece
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecordingRefused(f"{path}: cannot be read ({reason}); copy it again") from None


def _unpacked(file: BinaryIO, packed: bool) -> io.BufferedReader | gzip.GzipFile:
    stream: io.BufferedReader = io.BufferedReader(_Reader(file), limits.PIECE)
    return gzip.GzipFile(fileobj=stream) if packed else stream
