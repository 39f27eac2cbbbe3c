"""An append-only file of lines: each line is on the disk as a whole, or not at all."""

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from rulec_runtime.output.open_file import opened


class Appended:
    """A file of lines, open for one process at a time; its `lines` are read before any is added.

    A process that was killed may leave half a line at the end (`half`, `cut`). Raises OSError if
    the file cannot be opened, BlockingIOError if another process holds it.
    """

    def __init__(self, path: Path) -> None:
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        self.path = path
        self._size = 0
        self._file = os.open(path, flags, 0o666)
        try:
            if not stat.S_ISREG(os.fstat(self._file).st_mode):
                raise OSError(errno.EINVAL, "this is no file", str(path))
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until this process ends
            _sync_folder(path)
        except BaseException:
            os.close(self._file)
            raise

    def lines(self, longest: int) -> Iterator[bytes]:
        """All whole lines without their ends; a line that is too long is cut and ends them."""
        size = 0
        with opened(self.path) as file:
            while line := file.readline(longest + 2):
                if len(line) > longest + 1:
                    yield line
                    return
                if line.endswith(b"\n"):
                    size += len(line)
                    yield line[:-1]
        self._size = size

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
            return os.path.samestat(os.stat(self.path), os.fstat(self._file))
        except OSError:
            return False

    def close(self) -> None:
        """Release the file for other processes."""
        os.close(self._file)


def _sync_folder(path: Path) -> None:
    """Write the folder as well, so that a new file survives a power failure."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
