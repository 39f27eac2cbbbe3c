"""The only place that opens files of the user, and decides what may be opened.

Only regular files: a pipe may never end, and a device may do anything. No file larger than its kind
can be. A file may only name files near it, and addresses of a few schemes.
"""

import errno
import functools
import io
import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

from rulec_runtime import limits
from rulec_runtime.output.refusal import Refusal

FOLDERS = "RULEC_FILES"
"""Environment variable: further folders that files may refer to, separated as in PATH."""

SCHEMES = ("s3", "gs", "abfs", "abfss", "https", "http", "file")
"""Schemes of addresses that are read. Others of fsspec run code, nest, or reach into archives."""


def opened(path: str | Path, most: int | None = None, buffering: int = -1) -> BinaryIO:
    """Open a regular file of at most `most` bytes, or a link to one. Raises OSError, ValueError."""
    _refuse(os.stat(path), path, most)  # before it is opened: opening may affect a device
    file = open(path, "rb", buffering, opener=_without_waiting)  # noqa: SIM115
    try:
        _refuse(os.fstat(file.fileno()), path, most)  # it may have been replaced meanwhile
    except OSError:
        file.close()
        raise
    return file


def begin_of(path: str | Path, most: int) -> bytes:
    """The first bytes of a file, at most `most`. Raises OSError, ValueError."""
    with opened(path) as file:
        # As many bytes as are read are reserved; some files of /proc report no size.
        return file.read(min(most, os.fstat(file.fileno()).st_size or most))


def bytes_of(path: str | Path, most: int) -> bytes:
    """All bytes of a file of at most `most` bytes. Raises OSError, ValueError."""
    with opened(path, most) as file:
        data = file.read(most + 1)  # it may grow, and some files of /proc report no size
    _refuse_size(len(data), path, most)
    return data


def text_of(path: str | Path, most: int) -> str:
    """The same as text in UTF-8, with or without byte order mark, with any line ends."""
    return io.TextIOWrapper(io.BytesIO(bytes_of(path, most)), "utf-8-sig").read()


def is_near(target: Path, folder: Path) -> bool:
    """Whether a file that a file in `folder` names lies below that folder, below its parent (plants
    share files), or below a folder of `RULEC_FILES`; links are followed."""
    return _is_in(target, _near(os.path.abspath(folder), os.environ.get(FOLDERS, "")))


def is_named(target: Path) -> bool:
    """Whether a path lies below a folder of `RULEC_FILES`; links are followed."""
    named = os.environ.get(FOLDERS, "").split(os.pathsep)
    return _is_in(target, (os.path.realpath(one) for one in named if one))


def is_below(target: Path, folder: Path) -> bool:
    """Whether a path lies in a folder; links are followed."""
    return _is_in(target, (os.path.realpath(folder),))


@functools.lru_cache(maxsize=16)
def _near(folder: str, named: str) -> tuple[str, ...]:
    """Cached, as a file may name thousands of others."""
    home = os.path.realpath(folder)
    parent = os.path.dirname(home)
    # Everything lies below the root, so the root does not count as a parent.
    first = home if os.path.dirname(parent) == parent else parent
    return (first, *(os.path.realpath(one) for one in named.split(os.pathsep) if one))


def _is_in(target: Path, folders: Iterable[str]) -> bool:
    try:
        real = os.path.realpath(target)
    except ValueError:  # a zero in its name
        return False
    return any(real == one or real.startswith(os.path.join(one, "")) for one in folders)


def check_address(address: str) -> str:
    """An address of one of `SCHEMES` that nests no other; raises `Refusal` for any other."""
    if address.partition("://")[0] in SCHEMES and "::" not in address:
        return address
    raise Refusal(
        f"'{address[:80]}' is no address that recordings are read from; write a path, or one of "
        f"{', '.join(f'{name}://' for name in SCHEMES)}"
    )


def _without_waiting(path: str, flags: int) -> int:
    """A pipe that has replaced the checked file must not block us."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))


def _refuse(found: os.stat_result, path: str | Path, most: int | None) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "this is no file but a folder", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "this is no file but a pipe or a device", str(path))
    _refuse_size(found.st_size, path, limits.LARGEST_FILE if most is None else most)


def _refuse_size(size: int, path: str | Path, most: int) -> None:
    if size > most:
        text = f"it has more than {most / 1e6:,.0f} MB, as no file of its kind has"
        raise OSError(errno.EFBIG, text, str(path))
