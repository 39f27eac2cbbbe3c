"""A cache for the next start, in a folder that only the user can access.

Entries are bytes with their checksum. Nothing is unpickled. An entry is valid only if this user
wrote it here under this name; anything else is ignored and overwritten. Several processes may read
and write at once, as files appear as a whole.
"""

import functools
import hashlib
import os
import stat
import sys
from contextlib import suppress
from pathlib import Path

from rulec_runtime import limits
from rulec_runtime.output.open_file import bytes_of
from rulec_runtime.output.terminal import say_aside
from rulec_runtime.output.write_file import write_private

CHOSEN, OFF = "RULEC_CACHE", "off"
"""Environment variable that names the folder, and its value that turns the cache off."""

_MARK = b"rulec kept 1"


def cached(name: str) -> bytes | None:
    """What was cached under a name; None if there is nothing, or nothing that can be trusted."""
    folder = _folder()
    if folder is None:
        return None
    file = folder / name
    try:
        if _why_not(folder.lstat()):
            return None
        head, _, body = bytes_of(file, limits.MOST_CACHED_BYTES).partition(b"\n")
    except (OSError, ValueError):
        return None
    if head != _head(name, body):
        return None
    with suppress(OSError):
        os.utime(file)  # the least recently used entries are removed first
    return body


def keep(name: str, body: bytes) -> None:
    """Cache bytes under a name, and remove the oldest entries if there are too many.

    A failure is reported once; the next start then does the work again.
    """
    folder = _folder()
    if folder is None or len(body) > limits.MOST_CACHED_BYTES // 2:
        return
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        reason = _why_not(folder.lstat())
        if not reason:
            write_private(folder / name, _head(name, body) + b"\n" + body)
            _remove_oldest(folder)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
    if reason:
        _say(str(folder), reason)


def _folder() -> Path | None:
    """The folder of the cache, which need not exist; None if there is no cache."""
    chosen = os.environ.get(CHOSEN, "")
    if chosen == OFF:
        return None
    if chosen:
        return Path(chosen) / "plants"
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", "")
    else:
        base = os.environ.get("XDG_CACHE_HOME", "")
    try:
        # XDG ignores relative paths.
        usual = Path(base) if os.path.isabs(base) else Path.home() / ".cache"
    except RuntimeError:  # a user without a home
        return None
    return usual / "rulec" / "plants"


def _why_not(found: os.stat_result) -> str:
    """Why a folder cannot be trusted; empty if it can."""
    if not stat.S_ISDIR(found.st_mode):
        return "it is a link or no folder"
    if not hasattr(os, "geteuid"):  # files have no owners on this system
        return ""
    if found.st_uid != os.geteuid():
        return "it belongs to another user"
    return "others may read or write it" if found.st_mode & 0o077 else ""


def _head(name: str, body: bytes) -> bytes:
    """First line of a file: its format, its name, and the checksum of the rest."""
    return b" ".join((_MARK, name.encode(), hashlib.sha256(body).hexdigest().encode()))


def _remove_oldest(folder: Path) -> None:
    """Also removes partial files of killed processes; others may remove files at the same time."""
    files = []
    with os.scandir(folder) as entries:
        for entry in entries:
            with suppress(OSError):
                if entry.is_file(follow_symlinks=False):
                    found = entry.stat(follow_symlinks=False)
                    files.append((found.st_mtime_ns, found.st_size, entry.path))
    size = sum(bytes_ for _, bytes_, _ in files)
    for _, bytes_, path in sorted(files):
        if size <= limits.MOST_CACHED_BYTES:
            return
        with suppress(OSError):
            os.unlink(path)
        size -= bytes_


@functools.cache
def _say(folder: str, reason: str) -> None:
    say_aside(
        f"rulec: {folder} is not used ({reason}), so what is compiled is compiled anew at every "
        f"start; set {CHOSEN} to a folder that can be written, or to '{OFF}'"
    )
