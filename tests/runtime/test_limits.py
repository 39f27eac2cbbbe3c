"""Numbers that decide: each stands once, with its meaning and its origin."""

from __future__ import annotations

import ast
import importlib
import re
from collections import Counter
from collections.abc import Iterator
from numbers import Real
from pathlib import Path

import pytest

from tests.conftest import ROOT

ORIGIN = re.compile(r"Origin: (distribution|source|standard|measured by `|numerical|assumed)\b.*$")
"""How the last sentence of a docstring begins."""

LAYOUT = {
    "rulec_runtime.report": "how many names, rows and columns a page or a screen shows",
    "rulec_runtime.output.terminal": "how much of a piece of data a screen shows",
    "rulec_runtime.live.view.blocks": "cells of a bar on the screen",
    "rulec_runtime.contract.degree": "a large degree is written as 'over it'",
    "rulec_runtime.diagnosis.steady.verdict": "how many names a remark lists",
    "rulec_runtime.recordings.header": "how many names a remark lists",
    "rulec_runtime.recordings.recording": "how many names a remark lists",
    "rulec_runtime.contract.ruleset": "version of a format",
    "rulec_runtime.recordings.wall_clock": "units of time",
    "rulec_runtime.diagnosis.sensors.units": "units of time",
    "rulec_runtime.contract.plan": "samples at a time: speed alone",
    "rulec_runtime.recordings.text_parts": "rows at a time: speed alone",
    "rulec_runtime.fleet.plant_day": "version of a format",
    "rulec_runtime.recordings.formats": "how many tables a message lists",
    "rulec_runtime.recordings.recording_file": "how many words a remark lists",
    "rulec_runtime.recordings.long_table": "units of time",
    "rulec_runtime.recordings.zone": "units of time",
    "rulec_runtime.recordings.readers": "bytes at a time, and numbers of file formats",
    "rulec_runtime.diagnosis.steady.evaluated_points": "samples at a time: memory alone",
    "rulec_runtime.simulation.integrator": "compiled in: numba's cache sees no other file",
    "rulec_runtime.machine_code.code": "numbers at a time: speed alone",
    "rulec_runtime.commands.journal": "exit code",
    "rulec_runtime.live.journal.device_health": "numbers of nodes in a standard",
    "rulec_runtime.output.write_file": "flags of the operating system",
}
"""Modules, or rooms, that may hold numbers of their own, and why."""

FILES = [p for top in ("rulec", "runtime") for p in sorted((ROOT / top).rglob("limits.py"))]


def constants(file: Path) -> Iterator[tuple[str, str]]:
    """Upper-case names that a module defines, each with the docstring below it."""
    body = ast.parse(file.read_text(encoding="utf-8")).body
    for node, below in zip(body, [*body[1:], None], strict=True):
        match node:
            case ast.Assign(targets=[target]) | ast.AnnAssign(target=target):
                names = target.elts if isinstance(target, ast.Tuple) else [target]
            case _:
                continue
        text = ""
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            text = str(below.value.value)
        for name in names:
            if isinstance(name, ast.Name) and name.id.lstrip("_").isupper():
                yield name.id, text


@pytest.mark.parametrize("file", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_number_has_a_meaning_and_an_origin(file: Path) -> None:
    without = [n for n, text in constants(file) if not ORIGIN.search(" ".join(text.split()))]
    assert without == []


def test_every_number_is_used() -> None:
    """By the code, not by tests alone."""
    code = [p for top in ("rulec", "runtime") for p in (ROOT / top).rglob("*.py")]
    used = Counter(
        name
        for file in code
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Load)
        for name in [node.id if isinstance(node, ast.Name) else node.attr]
        if name.isupper()
    )
    found = [(file, name) for file in FILES for name, _ in constants(file)]
    assert len(found) > 100
    assert [] == [(file, name) for file, name in found if not used[name]]


def test_numbers_stand_in_limits_alone() -> None:
    """Other modules of the runtime define none, but for those that decide nothing."""
    found = []
    for file in sorted((ROOT / "runtime" / "rulec_runtime").rglob("*.py")):
        name = ".".join(file.relative_to(ROOT / "runtime").with_suffix("").parts)
        if name.endswith((".limits", "__init__", "__main__")):
            continue
        if any(name == part or name.startswith(f"{part}.") for part in LAYOUT):
            continue
        module = importlib.import_module(name)
        for constant, _ in constants(file):
            value = getattr(module, constant)
            first = value[0] if isinstance(value, tuple) else value
            if isinstance(first, Real) and not isinstance(first, bool):
                found.append(f"{name}.{constant}")
    assert found == []
