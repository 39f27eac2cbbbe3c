"""Figures measured again: a command run, and what it gives written into ledger and pages."""

import ast
import datetime
import functools
import hashlib
import io
import json
import re
import shlex
import subprocess
import sys
import tokenize
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.conftest import ROOT
from tests.figures.ledger import Ledger, Measurement, Share, replaced

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


LIMIT = 7200.0  # s; the longest command takes half an hour on two cores


def measured_again(measurement: Measurement, ledger: Ledger) -> Measurement:
    """Its values as they are now; raises RuntimeError if the command fails, KeyError if a value is
    not in its JSON."""
    form = output_of(measurement.command)
    return replace(
        measurement,
        values={path: picked(form, path) for path in measurement.values},
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        commit=_commit(),
        content=content_of(measurement, ledger),
    )


def output_of(command: str) -> Any:
    """Run a command of this project; its JSON. Raises RuntimeError."""
    call = [sys.executable, *shlex.split(command)[1:]]
    done = subprocess.run(
        call, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{command} failed:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout)


def picked(form: Any, path: str) -> float | Share:
    """The value at `a/b/c`; a share has `count` and `of`. Raises KeyError."""
    for word in path.split("/"):
        form = form[int(word)] if isinstance(form, list) else form[word]
    # As many digits as the ledger keeps: pages are checked against these.
    return Share(form["count"], form["of"]) if isinstance(form, Mapping) else float(f"{form:.6g}")


def write(measurement: Measurement, root: Path = ROOT) -> None:
    """Put values, date, commit and content into the ledger, and values into the pages; all else in
    them stays as it is."""
    file = root / "docs" / "figures.yaml"
    file.write_text(_with(measurement, file.read_text(encoding="utf-8")), encoding="utf-8")
    for page, template in measurement.prints:
        text = (root / page).read_text(encoding="utf-8")
        (root / page).write_text(replaced(template, text, measurement.values), encoding="utf-8")


def _with(measurement: Measurement, text: str) -> str:
    """The ledger's text with one measurement's fields replaced."""
    begin = text.index(f"  - id: {measurement.id}\n")
    end = text.index("    prints:\n", begin)
    block, m = text[begin:end], measurement
    fields = {"date": m.date, "commit": f'"{m.commit}"', "content": f'"{m.content}"'}
    fields |= {path: _written(value) for path, value in m.values.items()}
    for name, value in fields.items():
        line = rf"^( +{re.escape(name)}: ).*$"
        block = re.sub(line, rf"\g<1>{value}", block, count=1, flags=re.MULTILINE)
    return text[:begin] + block + text[end:]


def _written(value: float | Share) -> str:
    if isinstance(value, Share):
        return f"{{count: {value.count}, of: {value.of}}}"
    return f"{value:.6g}"


def _commit() -> str:
    """The commit that is checked out, with a + if files differ from it."""
    words = ["git", "describe", "--always", "--abbrev=7", "--dirty=+", "--exclude=*"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"
