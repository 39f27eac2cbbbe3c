"""A CSV file of a logger, read as it grows and across its rotations."""

import hashlib
import os
import re
import time as clocks
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.table_head import LineCutter
from rulec_runtime.live.sources.table_stream import TextSource
from rulec_runtime.output.open_file import opened
from rulec_runtime.recordings.csv_table import RecordingRefused, Unclear


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


def following(file: BinaryIO, path: Path) -> Path:
    """The file to read after one that was replaced.

    Usually that of the same name. After several rotations, the oldest file that was written later
    and has a name such as ``x.csv.1``, ``x.csv-20260301`` or ``x-20260301.csv``.
    """
    last, inodes = os.fstat(file.fileno()).st_mtime_ns, (path.stat().st_ino, inode_of(file))
    found = []
    for other in _rotated(path):
        with suppress(OSError):
            about = other.stat()
            if about.st_mtime_ns > last and about.st_ino not in inodes:
                found.append((about.st_mtime_ns, other))
    return min(found)[1] if found else path


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
        self._file: BinaryIO | None = None
        self._started = self._refused = self._missing = False
        self._replaced: float | None = None
        self._waiting: list[Rows | Notice] = []
        if resume:
            self._resume(resume)
        elif not path.is_file():
            raise RecordingRefused(f"{path}: there is no such file; start the logger first")
        if self._file is None and path.is_file():
            self._open(path)
        if self._file is not None and self._table.head is None:
            self._waiting += self._read(self._file)
            self._table.check()
        self._started = True

    @property
    def position(self) -> dict[str, Any]:
        """Where reading continues after the rows handed out so far; can be stored as JSON."""
        if self._file is None:
            return {}
        offset = self._cutter.offset
        if self._table.head is None:
            # Its lines are read again: rows below a head need it.
            offset = os.fstat(self._file.fileno()).st_size
        return {
            "inode": inode_of(self._file),
            "offset": offset,
            "header": self._table.head is not None,
            "tail": hashlib.sha256(tail_of(self._file, offset)).hexdigest(),
            "time": self._clock.last if self._clock.begun else None,
            "step": self._clock.step,
            "shift": self._clock.shift,
            "dated": self._clock.dated,
            "known": self._table.known,
        }

    def take(self, seconds: float) -> list[Rows | Notice]:
        until = clocks.monotonic() + seconds
        while not self.ended:
            found, self._waiting = self._waiting, []
            try:
                found += self._read_new()
            except OSError as error:
                found += self._lost(f"cannot be read ({error.strerror})")
            left = until - clocks.monotonic()
            if found or left <= 0:
                return found
            clocks.sleep(min(limits.POLL, left))
        return []

    def close(self) -> None:
        self.ended = True
        if self._file is not None:
            self._file.close()
            self._file = None

    def _read_new(self) -> list[Rows | Notice]:
        if self._file is None and not self._path.is_file():
            return self._lost("is not there")
        file = self._file or self._open(self._path)
        if os.fstat(file.fileno()).st_size < self._cutter.offset + self._cutter.waiting:
            self._open(self._path)
            return [self._notice("gap", " was cut short; rows not yet read are lost")]
        return self._read(file)

    def _read(self, file: BinaryIO) -> list[Rows | Notice]:
        """Rows of the next piece of the file."""
        data = file.read(limits.PIECE)
        if not data:
            return self._end_of_file()
        self._replaced = None
        return self._heard(self._rows(self._cutter.feed(data)), self._found_again())

    def _rows(self, lines: list[str], ended: bool = False) -> list[Rows | Notice]:
        """Rows of further lines. Raises before the first row, if the head is of another plant or
        something is ambiguous: whoever starts the watch can say what is meant."""
        if self._refused:
            return []
        try:
            if self._packed:
                text = "a packed file does not grow; name the one written to"
                raise RecordingRefused(f"{self._path}: {text}")
            return self._table.feed(lines, ended)
        except RecordingRefused as refused:
            started = self._started or self._table.head is not None
            if not started or (isinstance(refused, Unclear) and not self._clock.begun):
                raise
            self._refused = True
            return [self._refusal(refused)]

    def _open(self, path: Path) -> BinaryIO:
        self.close()
        self._file = file = opened(path, buffering=0)
        self._replaced, self.ended, self._refused = None, False, False
        self._cutter = LineCutter()
        self._packed = tail_of(file, 2) == b"\x1f\x8b"
        self._table = self._new_table(self._table.known)
        self._clock.begins = True
        return file

    def _end_of_file(self) -> list[Rows | Notice]:
        """Nothing more has come: the file may have been replaced, or be silent for too long."""
        assert self._file is not None
        there = self._path.is_file()
        if there and self._path.stat().st_ino == inode_of(self._file):
            self._replaced = None
            return [*self._found_again(), *self._stale()]
        now = clocks.monotonic()
        self._replaced = self._replaced or now
        if now - self._replaced < limits.LINGER:
            return []
        if self._table.head is None and (rows := self._rows([], ended=True)):
            return rows
        if not there:
            return self._lost("was taken away; its successor is waited for")
        found: list[Rows | Notice] = []
        if self._cutter.waiting:
            text = ": the last row before it was replaced has no end; left out"
            found.append(self._notice("refused", text))
        self._open(following(self._file, self._path))
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
        self._table = self._new_table(position.get("known", {}))
        offset = int(position["offset"])
        for path in with_inode(self._path, int(position["inode"])):
            file = self._open(path)
            if hashlib.sha256(tail_of(file, offset)).hexdigest() != position["tail"]:
                continue
            if not position["header"]:
                return
            lines = self._cutter.feed(file.read(min(offset, 2 * limits.LONGEST_LINE)))
            if not self._table.go_on(lines):
                continue
            self._cutter = LineCutter(self._cutter.encoding, offset)
            file.seek(offset)
            self._clock.begins = False
            return
        self.close()
        self.ended = False
        self._clock.begins = True
        text = ": what was being read is gone; rows may be lost"
        self._waiting.append(self._notice("gap", text))
