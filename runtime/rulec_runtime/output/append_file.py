"""A file that lines are added to: each is there as a whole, and on the disk, or not at all."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from rulec_runtime.output.open_file import opened


class Appended:
    """A file of lines, open for one process at a time.

    At its end may stand half a line, left by a process that was killed: `half`, to be `cut` before
    lines are added. Raises OSError where it cannot be opened, BlockingIOError where another process
    has it.
    """

    def __init__(self, path: Path) -> None:
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_CLOEXEC", 0)
        flags |= getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        flags |= getattr(os, "O_BINARY", 0)
        self.path = path
        self._file = os.open(path, flags, 0o666)
        try:
            if not stat.S_ISREG(os.fstat(self._file).st_mode):
                raise OSError(errno.EINVAL, "this is no file", str(path))
            _lock(self._file)
            self._size = self._whole()
            _keep_name(path)
        except BaseException:
            os.close(self._file)
            raise

    def lines(self, longest: int) -> Iterator[bytes]:
        """All whole lines, without their ends; of a longer one the begin in its place."""
        with opened(self.path) as file:
            while line := file.readline(longest + 2):
                if len(line) > longest + 1:
                    yield line
                    return
                if line.endswith(b"\n"):
                    yield line[:-1]

    def half(self, most: int) -> bytes:
        """What stands behind the last whole line, so many bytes of it at most."""
        with opened(self.path) as file:
            file.seek(self._size)
            return file.read(most)

    def cut(self) -> None:
        """Take off what stands behind the last whole line."""
        if os.fstat(self._file).st_size > self._size:
            os.ftruncate(self._file, self._size)

    def add(self, text: str) -> None:
        """Add whole lines; on the disk when this returns. Raises OSError, and nothing is added."""
        data = text.encode("utf-8", "backslashreplace")
        self.cut()  # where that failed last time
        try:
            left = memoryview(data)
            while left:
                left = left[os.write(self._file, left) :]
            os.fsync(self._file)
        except OSError:
            os.ftruncate(self._file, self._size)
            raise
        self._size += len(data)

    def still_there(self) -> bool:
        """Is it the file of that name? It may have been moved away, as logs are."""
        try:
            found, mine = os.stat(self.path), os.fstat(self._file)
        except OSError:
            return False
        return (found.st_dev, found.st_ino) == (mine.st_dev, mine.st_ino)

    def close(self) -> None:
        """Let others have it."""
        os.close(self._file)

    def _whole(self) -> int:
        """Bytes up to the end of the last whole line."""
        end = os.fstat(self._file).st_size
        with opened(self.path) as file:
            while end > 0:
                begin = max(end - (1 << 16), 0)
                file.seek(begin)
                found = file.read(end - begin).rfind(b"\n")
                if found >= 0:
                    return begin + found + 1
                end = begin
        return 0


def _lock(file: int) -> None:
    """One process at a time; the lock ends with it, however it ends."""
    try:
        import fcntl
    except ImportError:  # no such locks on this system
        return
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _keep_name(path: Path) -> None:
    """A new file is found again after a power failure: its folder is written as well."""
    try:
        folder = os.open(path.parent, os.O_RDONLY)
    except OSError:  # folders cannot be opened on this system
        return
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
