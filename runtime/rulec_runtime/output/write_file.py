"""All files are written here: as a whole or not at all, and never anywhere else.

A file grows under a name of its own in the same folder, made anew (an existing file or link of that
name is never opened), and takes its place at once. Who reads sees the old or the new content; of
two who write at once, the last one's stands, whole. Whatever goes wrong, the old file stays and
nothing is left behind.
"""

from __future__ import annotations

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
"""Folders whose entries stand for what is open already, as /dev/stdout does."""


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole or not at all."""
    with written(path) as file:
        file.write(text)


def write_data(path: Path, data: bytes) -> None:
    """Write a file as a whole or not at all, and onto the disk: the machine may fail next."""
    with _replacing(path) as part, _opened(part, _NEW) as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def write_private(path: Path, data: bytes) -> None:
    """Write a file that nobody else can read, as a whole or not at all."""
    with _replacing(path) as part, _opened(part, _NEW, 0o600) as file:
        file.write(data)


@contextmanager
def written(path: Path) -> Iterator[TextIO]:
    """A file to write to, packed if its name ends with .gz; it is there when all is written.

    A link is replaced, not followed: nothing is written where the link points. What is no file
    (a pipe, a terminal, /dev/null, /dev/stdout) is written through.
    """
    through = _is_through(path)
    if not through and path.is_dir() and not path.is_symlink():
        text = "this is a folder; give the name of a file"
        raise IsADirectoryError(errno.EISDIR, text, str(path))
    with ExitStack() as stack:
        part = stack.enter_context(_replacing(path, through))
        file: Any = stack.enter_context(_opened(part, os.O_WRONLY if through else _NEW))
        if path.name.lower().endswith(".gz"):
            # No date and no name in it: the same content gives the same bytes.
            file = stack.enter_context(gzip.GzipFile("", "wb", fileobj=file, mtime=0))
        yield stack.enter_context(
            io.TextIOWrapper(file, encoding="utf-8", errors="backslashreplace", newline="\n")
        )


@contextmanager
def _replacing(path: Path, through: bool = False) -> Iterator[Path]:
    """A new name beside a file, whose place it takes in the end; of what failed nothing is left.
    What is written `through` keeps its own."""
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
            error.filename, error.filename2 = str(path), None  # the user asked for this one
        raise


def _is_through(path: Path) -> bool:
    """Whether what is there is no file of its own, but leads to somebody who takes the bytes."""
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
    """A file to write to; a new one has these rights, as far as the user's umask gives them."""
    return os.fdopen(os.open(path, flags, rights), "wb")
