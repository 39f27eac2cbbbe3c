"""The only place that writes files: as a whole or not at all.

A new temporary file in the same folder (an existing file or link of its name is never opened)
replaces the target at once. Readers see the old or the new content; if two processes write, the
last one wins as a whole. After an error the old file stays and no temporary file is left.
"""

import errno
import gzip
import io
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
_NEW |= getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)

_DEVICES = ("/dev", "/proc")
"""Folders whose entries stand for open files, as /dev/stdout does."""


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole or not at all."""
    with written(path) as file:
        file.write(text)


def write_data(path: Path, data: bytes) -> None:
    """Write a file as a whole or not at all, synced to the disk in case the machine fails next."""
    with _replacing(path) as part, _opened(part, _NEW) as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def write_private(path: Path, data: bytes) -> None:
    """Write a file that only its owner can read, as a whole or not at all."""
    with _replacing(path) as part, _opened(part, _NEW, 0o600) as file:
        file.write(data)


@contextmanager
def written(path: Path) -> Iterator[TextIO]:
    """A file to write to, compressed if its name ends with .gz; it appears once it is complete.

    A link is replaced, not followed. What is not a file (a pipe, a terminal, /dev/null,
    /dev/stdout) is written directly.
    """
    through = _is_through(path)
    if not through and path.is_dir() and not path.is_symlink():
        text = "this is a folder; give the name of a file"
        raise IsADirectoryError(errno.EISDIR, text, str(path))
    with ExitStack() as stack:
        part = stack.enter_context(_replacing(path, through))
        file: Any = stack.enter_context(_opened(part, os.O_WRONLY if through else _NEW))
        if path.name.lower().endswith(".gz"):
            # Without date and name, so that the same content gives the same bytes.
            file = stack.enter_context(gzip.GzipFile("", "wb", fileobj=file, mtime=0))
        yield stack.enter_context(
            io.TextIOWrapper(file, encoding="utf-8", errors="backslashreplace", newline="\n")
        )


@contextmanager
def _replacing(path: Path, through: bool = False) -> Iterator[Path]:
    """A temporary path that replaces the file in the end and is removed after an error; the path
    itself if it is written `through`."""
    part = path if through else path.with_name(f".rulec-{secrets.token_hex(8)}.part")
    try:
        yield part
        if not through:
            os.replace(part, path)
    except BaseException as error:
        if not through:
            with suppress(OSError):
                part.unlink()
        if isinstance(error, OSError) and error.filename in (None, str(part)):
            error.filename, error.filename2 = str(path), None  # the name that the user gave
            if isinstance(error, FileNotFoundError):
                error.strerror = f"there is no folder '{path.parent}'; make it first"
        raise


def _is_through(path: Path) -> bool:
    """Whether the path is a pipe, a device, or a link to an open file."""
    try:
        kind = os.stat(path).st_mode
    except OSError:
        return False
    except ValueError as error:
        raise OSError(errno.EINVAL, str(error), str(path)) from None
    if not stat.S_ISREG(kind) and not stat.S_ISDIR(kind):
        return True
    folder = os.path.realpath(path.parent)
    return path.is_symlink() and any(folder == d or folder.startswith(f"{d}/") for d in _DEVICES)


def _opened(path: Path, flags: int, rights: int = 0o666) -> io.BufferedWriter:
    """A file to write to; a new one gets these permissions, limited by the umask."""
    return os.fdopen(os.open(path, flags, rights), "wb")
