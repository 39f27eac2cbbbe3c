"""An append-only file of lines: each line is on the disk as a whole, or not at all."""

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from rulec_runtime.output.open_file import opened


class Appended:
    """A file of lines, open for one process at a time.

    A process that was killed may leave half a line at the end (`half`, `cut`). Raises OSError if
    the file cannot be opened, BlockingIOError if another process holds it.
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
            _sync_folder(path)
        except BaseException:
            os.close(self._file)
            raise

    def lines(self, longest: int) -> Iterator[bytes]:
        """All whole lines without their ends; a line that is too long is cut and ends them."""
        with opened(self.path) as file:
            while line := file.readline(longest + 2):
                if len(line) > longest + 1:
                    yield line
                    return
                if line.endswith(b"\n"):
                    yield line[:-1]

    def half(self, most: int) -> bytes:
        """At most so many bytes of what follows the last whole line."""
        with opened(self.path) as file:
            file.seek(self._size)
            return file.read(most)

    def cut(self) -> None:
        """Remove what follows the last whole line."""
        if os.fstat(self._file).st_size > self._size:
            os.ftruncate(self._file, self._size)

    def add(self, text: str) -> None:
        """Add whole lines and sync them to the disk. Adds nothing if it raises OSError."""
        data = text.encode("utf-8", "backslashreplace")
        self.cut()  # the previous attempt may have failed
        left = memoryview(data)
        try:
            while left:
                left = left[os.write(self._file, left) :]
            os.fsync(self._file)
        except OSError:
            os.ftruncate(self._file, self._size)
            raise
        self._size += len(data)

    def still_there(self) -> bool:
        """Whether its path still leads to this file: logs are moved away."""
        try:
            found, mine = os.stat(self.path), os.fstat(self._file)
        except OSError:
            return False
        return (found.st_dev, found.st_ino) == (mine.st_dev, mine.st_ino)

    def close(self) -> None:
        """Release the file for other processes."""
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
    """Lock a file until this process ends, however it ends."""
    try:
        import fcntl
    except ImportError:  # this system has no such locks
        return
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _sync_folder(path: Path) -> None:
    """Write the folder as well, so that a new file survives a power failure."""
    try:
        folder = os.open(path.parent, os.O_RDONLY)
    except OSError:  # folders cannot be opened on this system
        return
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
