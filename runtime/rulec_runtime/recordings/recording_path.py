"""Resolve a path to a file, one table of it (FILE#TABLE), or standard input (-)."""

from __future__ import annotations

import errno
import functools
import io
import os
import sys
from pathlib import Path
from typing import BinaryIO

from rulec_runtime.output import open_file
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused

STANDARD_INPUT = Path("-")


def place_of(path: Path) -> tuple[Path, str]:
    """File or folder, and the name of a table in it, or an empty one.

    An existing file with # in its name is that file.

    >>> place_of(Path("-#slow"))
    (PosixPath('-'), 'slow')
    """
    text = str(path)
    if "#" not in text or path.exists():
        return path, ""
    for at in (i for i, sign in enumerate(text) if sign == "#"):
        file = Path(text[:at])
        if file == STANDARD_INPUT or file.exists():
            return file, text[at + 1 :].replace(os.sep, "/").strip("/")
    return path, ""


def is_there(path: Path) -> bool:
    """Whether a recording exists: a file, a folder, or standard input."""
    place = place_of(path)[0]
    return place == STANDARD_INPUT or place.exists()


def opened(path: Path) -> BinaryIO:
    """The bytes of a recording; standard input may be opened repeatedly."""
    place = place_of(path)[0]
    if place == STANDARD_INPUT:
        return io.BytesIO(_whole(sys.stdin.buffer))
    try:
        return open_file.opened(place)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        hint = "give - and let it come on standard input"
        raise RecordingRefused(f"{path}: {error.strerror}; {hint}") from None


def bytes_of(path: Path) -> bytes:
    """All bytes of a recording as it is stored."""
    with opened(path) as file:
        return file.read()


@functools.lru_cache(maxsize=1)
def _whole(stream: BinaryIO) -> bytes:
    """All bytes of a stream, cached because it can be read only once."""
    data = stream.read(limits.LARGEST_PIPE + 1)
    if len(data) > limits.LARGEST_PIPE:
        raise RecordingRefused(
            f"-: more than {limits.LARGEST_PIPE >> 20} MB came on standard input; give a file"
        )
    return data
