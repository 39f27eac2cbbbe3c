"""Is a figure older than what it depends on? Told by content, so it needs no history."""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

from tests.conftest import ROOT
from tests.figures.ledger import Figure, Ledger

LENGTH = 12  # digits of a hash: 48 bits, enough to tell a handful of states apart


def is_stale(figure: Figure, ledger: Ledger, root: Path = ROOT) -> bool:
    """Whether a file that a measured figure depends on changed since; others never are."""
    return figure.kind == "measured" and figure.content != content_of(figure, ledger, root)


def state_of(figure: Figure, ledger: Ledger) -> str:
    """`fresh`, `stale`, `sealed` or `quoted`."""
    if figure.kind != "measured":
        return figure.kind
    return "stale" if is_stale(figure, ledger) else "fresh"


def content_of(figure: Figure, ledger: Ledger, root: Path = ROOT) -> str:
    """Hash of all files that a figure depends on, as they are now."""
    patterns = [_pattern(glob) for name in figure.depends for glob in ledger.files[name]]
    lines = (
        f"{path} {blob}\n"
        for path, blob in sorted(blobs_here(root).items())
        if any(pattern.fullmatch(path) for pattern in patterns)
    )
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:LENGTH]


@functools.cache
def blobs_here(root: Path) -> Mapping[str, str]:
    """Hash of each file below the folders that are shipped, as git names its content."""
    found = {}
    for folder in ("runtime", "rulec", "kb", "plants", "tests"):
        for file in (root / folder).rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts and file.suffix != ".pyc":
                found[file.relative_to(root).as_posix()] = _blob(file.read_bytes())
    return found


def _blob(data: bytes) -> str:
    """Name of a file's content. Source: git, object of type blob."""
    return hashlib.sha1(b"blob %d\0" % len(data) + data, usedforsecurity=False).hexdigest()


def _pattern(glob: str) -> re.Pattern[str]:
    """`a/**` is all below a; `*` stays within a folder."""
    pieces = re.split(r"(\*\*|\*)", glob)
    return re.compile(
        "".join({"**": ".*", "*": "[^/]*"}.get(piece, re.escape(piece)) for piece in pieces)
    )
