"""Where the compiled integrator is kept: compiling takes 25 s, and no start should pay that twice.

numba keeps it beside the source or in the user's cache folder. Where neither is writable, as for an
installation of another user without a home, a private folder among the temporary files is used.
"""

import os
import stat
import tempfile
from pathlib import Path

from rulec_runtime.output.terminal import say_aside

CHOSEN = "NUMBA_CACHE_DIR"
"""Environment variable that sets numba's folder."""


def can_be_cached(source: str) -> bool:
    """Whether the code compiled from a source file can be kept; if not, warn once."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    named = os.environ.get(CHOSEN)
    usual = [Path(named)] if named else []
    usual += [Path(source).parent / "__pycache__", home / "numba"]
    if any(_is_writable(folder) for folder in usual):
        return True
    own = _own_folder()
    if own is not None:
        os.environ[CHOSEN] = str(own)
        return True
    say_aside(
        "rulec: the integrator is compiled anew at every start, which takes about 25 s, as there "
        f"is no folder to keep it in; set {CHOSEN} to a folder that can be written"
    )
    return False


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _own_folder() -> Path | None:
    """A folder among the temporary files, private to this user: code is loaded from it."""
    if not hasattr(os, "getuid"):
        return None
    try:
        folder = Path(tempfile.gettempdir()) / f"rulec-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o022
    return folder if private and found.st_uid == os.getuid() and _is_writable(folder) else None
