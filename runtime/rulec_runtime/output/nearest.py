"""The name that was probably meant by one that is not known, for messages."""

import contextlib
import difflib
from collections.abc import Iterable
from pathlib import Path

SHOWN = 12
"""Known names that a message lists."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that the author probably meant, if any."""
    names = sorted(known)
    same = [n for n in names if n.lower() == name.lower()]
    near = same or difflib.get_close_matches(name, names, n=1)
    return near[0] if near else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Suggest the nearest known name, or list the first known ones.

    >>> did_you_mean("k_leek", ["k_leak", "V"]), did_you_mean("x", ["k_leak", "V"])
    ("did you mean 'k_leak'?", 'known: V, k_leak')
    """
    names = sorted(known)
    near = nearest(name, names)
    if near is not None:
        return f"did you mean '{near}'?"
    if not names:
        return ""
    return f"known: {', '.join(names[:SHOWN])}{', ...' if len(names) > SHOWN else ''}"


def near_file(path: Path) -> str | None:
    """The name of a neighbour that was probably meant by a path that does not exist, if any."""
    with contextlib.suppress(OSError):
        return nearest(path.name, (one.name for one in path.parent.iterdir()))
    return None
