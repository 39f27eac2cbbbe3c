"""Is a figure older than what it depends on? Told by content, so it needs no history."""

import ast
import functools
import hashlib
import io
import tokenize
from pathlib import Path

from tests.conftest import ROOT
from tests.figures.ledger import Ledger, Measurement

LENGTH = 12  # digits of a hash: 48 bits, enough to tell a handful of states apart


def is_stale(measurement: Measurement, ledger: Ledger) -> bool:
    """Whether a file in its rooms changed since it was measured."""
    return bool(measurement.depends) and measurement.content != content_of(measurement, ledger)


def content_of(measurement: Measurement, ledger: Ledger, root: Path = ROOT) -> str:
    """Hash of all files in the measurement's rooms, as they are now."""
    files = {f for room in measurement.depends for f in files_of(ledger.rooms[room], root)}
    lines = (f"{file.relative_to(root).as_posix()} {_plain_hash(file)}\n" for file in sorted(files))
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:LENGTH]


def files_of(globs: tuple[str, ...], root: Path = ROOT) -> set[Path]:
    """Files below the root that fit. Raises ValueError for globs without any."""
    found = {glob: {f for f in root.glob(glob) if f.is_file()} for glob in globs}
    if empty := [glob for glob, files in found.items() if not files]:
        raise ValueError(f"no file fits {', '.join(empty)}")
    return set().union(*found.values())


@functools.cache
def _plain_hash(file: Path) -> str:
    """Hash of a file; of code without comments and docstrings."""
    data = file.read_bytes()
    if file.suffix == ".py":
        data = plain_code(data.decode()).encode()
    return hashlib.sha256(data).hexdigest()


def plain_code(source: str) -> str:
    """The source without comments, without strings that are statements, and without empty lines."""
    lines = source.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column]
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
            continue
        if isinstance(node.value.value, str) and node.end_lineno is not None:
            lines[node.lineno - 1 : node.end_lineno] = [""] * (node.end_lineno - node.lineno + 1)
    return "\n".join(line.rstrip() for line in lines if line.strip()) + "\n"
