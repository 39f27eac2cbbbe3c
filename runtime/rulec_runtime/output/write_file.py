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
    part = path.with_name(f".rulec-{secrets.token_hex(8)}.part")
    try:
        with _opened(part, through=False) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        if isinstance(error, OSError):
            error.filename, error.filename2 = str(path), None
        raise


def write_private(path: Path, data: bytes) -> None:
    """Write a file that nobody else can read, as a whole or not at all."""
    part = path.with_name(f".rulec-{secrets.token_hex(8)}.part")
    try:
        with os.fdopen(os.open(part, _NEW, 0o600), "wb") as file:
            file.write(data)
        os.replace(part, path)
    except BaseException:
        with suppress(OSError):
            part.unlink()
        raise


@contextmanager
def written(path: Path) -> Iterator[TextIO]:
    """A file to write to, packed if its name ends with .gz; it is there when all is written.

    A link is replaced, not followed: nothing is written where the link points. What is no file
    (a pipe, a terminal, /dev/null, /dev/stdout) is written through.
    """
    part: Path | None = None
    try:
        through = _is_through(path)
        if not through and path.is_dir() and not path.is_symlink():
            raise IsADirectoryError(errno.EISDIR, "this is a folder; give the name of a file")
        part = None if through else path.with_name(f".rulec-{secrets.token_hex(8)}.part")
        with ExitStack() as stack:
            file: Any = stack.enter_context(_opened(part or path, through))
            if path.name.lower().endswith(".gz"):
                # No date and no name in it: the same content gives the same bytes.
                file = stack.enter_context(gzip.GzipFile("", "wb", fileobj=file, mtime=0))
            yield stack.enter_context(
                io.TextIOWrapper(file, encoding="utf-8", errors="backslashreplace", newline="\n")
            )
        if part is not None:
            os.replace(part, path)
    except BaseException as error:
        if part is not None:
            with suppress(OSError):
                part.unlink()
        if isinstance(error, OSError) and error.filename in (None, str(part)):
            error.filename = str(path)  # the user asked for this one
            error.filename2 = None
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


def _opened(path: Path, through: bool) -> io.BufferedWriter:
    """A new file with the rights that the user's umask gives; or what is there, as it is."""
    flags = os.O_WRONLY if through else _NEW
    return os.fdopen(os.open(path, flags, 0o666), "wb")
