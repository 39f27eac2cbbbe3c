"""How much a packed file may unpack to: a small file must not fill the memory."""

from __future__ import annotations

from pathlib import Path

from rulec_runtime import limits
from rulec_runtime.recordings.csv_table import RecordingRefused


def most_unpacked(size: int) -> int:
    """Bytes that a packed file of `size` bytes may unpack to."""
    return max(limits.FREE_TO_UNPACK, limits.DENSEST * size)


def refuse_bomb(path: Path, unpacked: int, size: int) -> None:
    """Raise `RecordingRefused` where a file of `size` bytes unpacks to too many."""
    if unpacked > most_unpacked(size):
        raise RecordingRefused(
            f"{path}: it unpacks to more than {limits.DENSEST} times its size, as no "
            "recording does; if it is one, unpack it first"
        )
