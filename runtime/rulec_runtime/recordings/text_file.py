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

_AS_LATIN = "rulec-as-latin-1"


def _as_latin(error: UnicodeError) -> tuple[str, int]:
    """Bytes that are no text in the encoding of the file, as Latin-1, which accepts every byte."""
    assert isinstance(error, UnicodeDecodeError)
    return error.object[error.start : error.end].decode("latin-1"), error.end


codecs.register_error(_AS_LATIN, _as_latin)


class _Reader(io.RawIOBase):
    """A file read from its beginning; several readers are independent of each other."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._position = file, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: object) -> int:
        view = memoryview(buffer)  # type: ignore[arg-type]
        self._file.seek(self._position)
        found = self._file.read(len(view))
        view[: len(found)] = found
        self._position += len(found)
        return len(found)


@dataclass(frozen=True)
class TextFile:
    """Text in UTF-8 or in UTF-16 with a byte order mark, perhaps packed; `path` names it in
    messages."""

    file: BinaryIO
    path: Path

    def lines(self) -> Iterator[str]:
        """Its lines from the beginning, with their ends unchanged. Raises `RecordingRefused` where
        the file cannot be read, is binary, or unpacks to an implausible size."""
        try:
            size, total = self.file.seek(0, os.SEEK_END), 0
            stream = io.BufferedReader(_Reader(self.file), limits.PIECE)
            packed = stream.peek(2)[:2] == b"\x1f\x8b"
            unpacked = gzip.GzipFile(fileobj=stream) if packed else stream
            wide = unpacked.peek(2)[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
            decoding = ("utf-16", "strict") if wide else ("utf-8-sig", _AS_LATIN)
            text = io.TextIOWrapper(unpacked, *decoding, newline="")
            while line := text.readline(limits.LONGEST_LINE + 1):
                total += len(line)
                if packed:
                    refuse_bomb(self.path, total, size)
                if len(line) > limits.LONGEST_LINE:
                    raise RecordingRefused(
                        f"{self.path}: a line of it has more than {limits.LONGEST_LINE >> 20} MB, "
                        "as no recording has; export it again"
                    )
                if "\0" in line:
                    raise UnicodeError
                yield line
        except UnicodeError:
            raise RecordingRefused(
                f"{self.path}: this is a binary file; export the recording as CSV"
            ) from None
        except (OSError, EOFError, zlib.error) as error:
            reason = getattr(error, "strerror", None) or error
            raise RecordingRefused(
                f"{self.path}: cannot be read ({reason}); copy it again"
            ) from None
