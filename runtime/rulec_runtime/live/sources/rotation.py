"""Log rotation: identify files that replace each other, and find the next one."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.line_cutter import LineCutter
from rulec_runtime.live.sources.table_head import HeadSearch, TableHead
from rulec_runtime.output.open_file import opened
from rulec_runtime.recordings.csv_table import RecordingRefused


@dataclass(frozen=True)
class Head:
    """The head of a file: its `table`, its end, in bytes, and a digest of titles and units.

    The digest excludes lines above the titles, which may contain the start time. `whole` is False
    if further lines might change the head; `in_sight` is whether it looks like a table.
    """

    table: TableHead | None = None
    encoding: str = "utf-8"
    end: int = 0
    digest: str = ""
    whole: bool = True
    in_sight: bool = True


def head_of(file: BinaryIO, path: Path, times: Collection[str]) -> Head | None:
    """The head of a file as far as it was written; None without a line that may hold titles. Leaves
    the file at its start. Raises `RecordingRefused`."""
    file.seek(0)
    data = b""
    while len(data) <= limits.LONGEST_LINE and (piece := file.read(limits.PIECE)):
        data += piece
    file.seek(0)
    if data.startswith(b"\x1f\x8b"):
        raise RecordingRefused(f"{path}: a packed file does not grow; name the one written to")
    cutter, search = LineCutter(), HeadSearch(str(path), times)
    ends = [0]
    table = None
    for line in data.splitlines(keepends=True):
        for cut in cutter.feed(line):
            ends.append(cutter.offset)
            # Below the titles it is a broken row, which others may follow.
            if "\0" in cut and not search.in_sight:
                raise RecordingRefused(f"{path}: this is a binary file; a CSV file is read here")
            table = table or search.add(cut)
        if table:
            break
    whole = table is not None
    table = table or search.so_far()
    if not whole and len(data) > limits.LONGEST_LINE:
        raise RecordingRefused(f"{path}: no header in its first {limits.LONGEST_LINE} bytes")
    if table is None:
        return None
    digest = hashlib.sha256(data[ends[table.first] : ends[table.end]]).hexdigest()
    return Head(table, cutter.encoding, ends[table.end], digest, whole, search.in_sight)


def tail_of(file: BinaryIO, offset: int) -> bytes:
    """Some bytes before an offset; keeps the position of the file."""
    here = file.tell()
    start = max(0, offset - limits.TAIL)
    file.seek(start)
    tail = file.read(offset - start)
    file.seek(here)
    return tail


def inode_of(file: BinaryIO) -> int:
    return os.fstat(file.fileno()).st_ino


def with_inode(path: Path, inode: int) -> Iterator[Path]:
    """The file with an inode: at this path, or renamed in the same folder."""
    for other in (path, *(p for p in sorted(path.parent.iterdir()) if p != path)):
        try:
            if other.is_file() and other.stat().st_ino == inode:
                yield other
        except OSError:
            continue


def following(file: BinaryIO, path: Path, head: Head | None, times: Collection[str]) -> Path:
    """The file to read after one that was replaced.

    Usually that of the same name. After several rotations, the oldest file that was written later,
    has the same header, and a name such as ``x.csv.1``, ``x.csv-20260301`` or ``x-20260301.csv``.
    """
    last, current = os.fstat(file.fileno()).st_mtime_ns, path.stat().st_ino
    later = []
    for other in _rotated(path):
        try:
            about = other.stat()
            if about.st_mtime_ns <= last or about.st_ino in (current, inode_of(file)):
                continue
            with opened(other, buffering=0) as begun:
                found = head_of(begun, other, times)
        except (OSError, RecordingRefused):
            continue
        if head is not None and found is not None and found.digest == head.digest:
            later.append((about.st_mtime_ns, other))
    return min(later)[1] if later else path


def _rotated(path: Path) -> list[Path]:
    """Files with names of rotated versions of this one; ``x-2.csv`` may be another plant."""
    name, stem, suffix = (re.escape(part) for part in (path.name, path.stem, path.suffix))
    form = re.compile(rf"{name}[-_.]\d[-\dT:_.]*|{stem}[-_.]\d{{4}}[-\dT:_.]{{2,}}{suffix}")
    return [p for p in sorted(path.parent.iterdir()) if form.fullmatch(p.name) and p.is_file()]
