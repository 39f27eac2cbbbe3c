"""A CSV file of a logger, read as it grows and across its rotations."""

import hashlib
import os
import re
import time as clocks
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.table_head import HeadSearch, LineCutter, TableHead
from rulec_runtime.live.sources.table_stream import TextSource
from rulec_runtime.live.steady_clock import steady
from rulec_runtime.output.open_file import opened
from rulec_runtime.recordings.csv_table import RecordingRefused, Unclear
from rulec_runtime.recordings.recording_file import times_of


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


class GrowingFile(TextSource):
    """Rows of a file and of its successors.

    A partial line waits for its end. When the file is renamed or replaced, the old one is read to
    its end, then the new one from its start, header included; a truncated file is read from its
    start. A header of another plant is refused at the start; later it is reported, and reading
    continues with the next file.
    """

    def __init__(
        self, path: Path, ruleset: Ruleset, resume: Mapping[str, Any] | None = None
    ) -> None:
        super().__init__(path, ruleset)
        self._times = times_of(ruleset)
        self._file: BinaryIO | None = None
        self._head: Head | None = None
        self._started = self._refused = self._missing = False
        self._replaced: float | None = None
        self._tail = b""
        self._waiting: list[Rows | Notice] = []
        if path.name.lower().endswith(".gz"):
            raise RecordingRefused(f"{path}: a packed file does not grow; name the one written to")
        if resume:
            self._resume(resume)
        elif not path.is_file():
            raise RecordingRefused(f"{path}: there is no such file; start the logger first")
        if self._file is None and path.is_file():
            self._open(path)
            self._waiting += self._read_head()
        self._started = True

    @property
    def position(self) -> dict[str, Any]:
        """Where reading continues after the rows handed out so far; can be stored as JSON."""
        if self._file is None:
            return {}
        offset, tail = self._cutter.offset, self._tail
        if self._head is None:
            offset = os.fstat(self._file.fileno()).st_size
            tail = tail_of(self._file, offset)
        return {
            "inode": inode_of(self._file),
            "offset": offset,
            "header": self._head.digest if self._head else "",
            "tail": hashlib.sha256(tail).hexdigest(),
            "time": self._clock.last if self._clock.begun else None,
            "step": self._clock.step,
            "shift": self._clock.shift,
            "dated": self._clock.dated,
        }

    def take(self, seconds: float) -> list[Rows | Notice]:
        until = steady() + seconds
        while not self.ended:
            found, self._waiting = self._waiting, []
            try:
                found += self._look()
            except OSError as error:
                found += self._lost(f"cannot be read ({error.strerror})")
            left = until - steady()
            if found or left <= 0:
                return found
            clocks.sleep(min(limits.POLL, left))
        return []

    def close(self) -> None:
        self.ended = True
        if self._file is not None:
            self._file.close()
            self._file = None

    def _look(self) -> list[Rows | Notice]:
        if self._file is None and not self._path.is_file():
            return self._lost("is not there")
        file = self._file or self._open(self._path)
        if self._head is None:
            found = self._read_head()
            if found or self._head is None:
                return found or self._end_of_file()
        if self._was_cut(file):
            self._open(self._path)
            return [self._notice("gap", " was cut short; rows not yet read are lost")]
        data = file.read(limits.PIECE)
        if not data:
            return self._end_of_file()
        self._replaced = None
        before = self._cutter.offset
        lines = self._cutter.feed(data)
        if self._cutter.offset > before:
            self._tail = tail_of(file, self._cutter.offset)
        rows = self._rows(lines)
        if not self._heard(rows):
            return [*self._found_again(), *rows, *self._stale()]
        again: list[Notice] = self._found_again()
        if self._silence.heard() and not again:
            again = [self._notice("connected", ": rows come again")]
        return [*again, *rows]

    def _rows(self, lines: list[str]) -> list[Rows | Notice]:
        found = self._too_long()
        if self._refused:
            return found
        try:
            return found + self._table.feed(lines)
        except RecordingRefused as refused:
            if isinstance(refused, Unclear) and not self._clock.begun:
                raise  # whoever starts the watch can say what is meant
            self._refused = True
            return [*found, self._refusal(refused)]

    def _open(self, path: Path) -> BinaryIO:
        self.close()
        self._file = file = opened(path, buffering=0)
        self._head, self._replaced, self.ended, self._refused = None, None, False, False
        self._cutter, self._tail = LineCutter(), b""
        self._table = self._new_table()
        self._clock.begins = True
        return file

    def _read_head(self, ended: bool = False) -> list[Rows | Notice]:
        """Read the head once it is complete, or the file has `ended`. Raises only before the first
        file has started, and then also if only titles have come."""
        assert self._file is not None
        try:
            head = head_of(self._file, self._path, self._times)
            if head is None or head.table is None:
                return []
            if not head.whole and not ended:
                if head.in_sight and not self._started:
                    self._new_table().begin(head.table)
                return []
            self._head = head
            self._cutter = LineCutter(head.encoding, head.end)
            self._tail = tail_of(self._file, head.end)
            self._table.begin(head.table)
            return []
        except RecordingRefused as refused:
            if not self._started:
                raise
            self._head = self._head or Head()
            self._refused = True
            return [self._refusal(refused)]
        finally:
            self._file.seek(self._cutter.offset if self._head else 0)

    def _was_cut(self, file: BinaryIO) -> bool:
        """Whether the file is shorter now, or was rewritten to beyond the current position."""
        size, end = os.fstat(file.fileno()).st_size, self._cutter.offset + self._cutter.waiting
        return size < end or (size > end and tail_of(file, self._cutter.offset) != self._tail)

    def _end_of_file(self) -> list[Rows | Notice]:
        """Nothing more has come: the file may have been replaced, or be silent for too long."""
        assert self._file is not None
        there = self._path.is_file()
        if there and self._path.stat().st_ino == inode_of(self._file):
            self._replaced = None
            return [*self._found_again(), *self._stale()]
        now = steady()
        self._replaced = self._replaced or now
        if now - self._replaced < limits.LINGER:
            return []
        if self._head is None:
            notices = self._read_head(ended=True)
            if self._head is not None:
                return notices
        if not there:
            return self._lost("was taken away; its successor is waited for")
        found: list[Rows | Notice] = []
        if self._cutter.waiting:
            text = ": the last row before it was replaced has no end; left out"
            found.append(self._notice("refused", text))
        self._open(following(self._file, self._path, self._head, self._times))
        return found

    def _lost(self, why: str) -> list[Rows | Notice]:
        """Reported once; the source becomes stale if it lasts."""
        if self._missing:
            return self._stale()
        self._missing = True
        return [self._notice("lost", f" {why}")]

    def _found_again(self) -> list[Notice]:
        if not self._missing:
            return []
        self._missing = False
        return [self._notice("connected", " is read again", still=self._silence.stale)]

    def _resume(self, position: Mapping[str, Any]) -> None:
        """Continue at a position in its file, wherever that is now."""
        if position["time"] is not None:
            self._clock.last = float(position["time"])
        self._clock.step, self._clock.shift = float(position["step"]), float(position["shift"])
        self._clock.dated = position["dated"]
        offset = int(position["offset"])
        for path in with_inode(self._path, int(position["inode"])):
            file = self._open(path)
            if hashlib.sha256(tail_of(file, offset)).hexdigest() != position["tail"]:
                continue
            if not position["header"]:
                self._waiting += self._read_head()
                return
            head = head_of(file, path, self._times)
            if head is None or head.digest != position["header"]:
                continue
            self._read_head(ended=True)
            self._cutter = LineCutter(head.encoding, offset)
            self._tail = tail_of(file, offset)
            file.seek(offset)
            if self._clock.begun:
                self._table.resume()
            self._clock.begins = False
            return
        self.close()
        self.ended = False
        self._clock.begins = True
        text = ": what was being read is gone; rows may be lost"
        self._waiting.append(self._notice("gap", text))
