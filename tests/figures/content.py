"""Is a figure older than what it depends on? Told by content, so it needs no history."""

from __future__ import annotations

import functools
import hashlib
import re
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

from tests.conftest import ROOT
from tests.figures.ledger import Figure, Ledger
from tests.figures.plain_code import plain_code
from tests.figures.sources import files_of, read_sources

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
    """Hash of all that a figure depends on, as it is now.

    That is the files which its command used when it was last run, or, where these were not noted,
    all files in its sets.
    """
    noted = read_sources().get(figure.command)
    if noted is not None:
        files = [file for path in noted for file in files_of(path, root)]
        return _digest(f"{file} {_plain_blob(root / file)}\n" for file in files)
    globs = [glob for name in figure.depends for glob in ledger.files[name]]
    return _hash(blobs_here(root), globs)


def content_at(commit: str, figure: Figure, ledger: Ledger, root: Path = ROOT) -> str:
    """The same as it was in a commit; needs git and its history."""
    globs = [glob for name in figure.depends for glob in ledger.files[name]]
    return _hash(_blobs_at(commit, root), globs)


@functools.cache
def blobs_here(root: Path) -> Mapping[str, str]:
    """Hash of each file below the folders that are shipped, as git names its content."""
    found = {}
    for folder in ("runtime", "rulec", "kb", "plants", "tests"):
        for file in (root / folder).rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts and file.suffix != ".pyc":
                found[file.relative_to(root).as_posix()] = _blob(file.read_bytes())
    return found


@functools.cache
def _blobs_at(commit: str, root: Path) -> Mapping[str, str]:
    listing = subprocess.run(
        ["git", "ls-tree", "-r", commit], cwd=root, capture_output=True, text=True, check=True
    )
    rows = [line.split(maxsplit=3) for line in listing.stdout.splitlines()]
    return {path: blob for _, _, blob, path in rows}


def _blob(data: bytes) -> str:
    """Name of a file's content. Source: git, object of type blob."""
    return hashlib.sha1(b"blob %d\0" % len(data) + data, usedforsecurity=False).hexdigest()


def _hash(blobs: Mapping[str, str], globs: Iterable[str]) -> str:
    patterns = [_pattern(glob) for glob in globs]
    return _digest(
        f"{path} {blob}\n"
        for path, blob in sorted(blobs.items())
        if any(pattern.fullmatch(path) for pattern in patterns)
    )


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:LENGTH]


@functools.cache
def _plain_blob(file: Path) -> str:
    """Hash of a file; of code without comments and docstrings. Of none: `gone`."""
    if not file.is_file():
        return "gone"
    if file.suffix != ".py":
        return _blob(file.read_bytes())
    return _blob(plain_code(file.read_text(encoding="utf-8")).encode())


def _pattern(glob: str) -> re.Pattern[str]:
    """`a/**` is all below a; `*` stays within a folder."""
    pieces = re.split(r"(\*\*|\*)", glob)
    return re.compile(
        "".join({"**": ".*", "*": "[^/]*"}.get(piece, re.escape(piece)) for piece in pieces)
    )
