"""Numbers that decide: each stands once, with its meaning and its origin."""

import ast
import importlib
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from numbers import Real
from pathlib import Path

import pytest

from tests.conftest import ROOT

ORIGIN = re.compile(r"Origin: (distribution|source|standard|measured by `|numerical|assumed)\b.*$")
"""How the last sentence of a docstring begins."""

LAYOUT = {
    "how many names, rows and columns a page, a screen or a remark shows": "report output.terminal "
    "output.nearest "
    "live.view.blocks contract.degree diagnosis.steady.verdict recordings.header "
    "recordings.recording recordings.formats recordings.recording_file",
    "version of a format": "contract.ruleset fleet.plant_day",
    "units of time": "recordings.plant_calendar diagnosis.sensors.units recordings.long_table "
    "recordings.dates",
    "rows or bytes at a time: speed and memory alone": "contract.plan recordings.text_table "
    "recordings.readers diagnosis.steady.evaluated_points",
    "compiled in: numba's cache sees no other file": "simulation.integrator",
    "exit code, numbers of a standard, flags of the operating system": "commands.journal "
    "live.journal.device_health output.write_file",
}
"""Why modules, or rooms, may hold numbers of their own."""

FILES = [p for top in ("rulec", "runtime") for p in sorted((ROOT / top).rglob("limits.py"))]


@cache
def parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def constants(file: Path) -> Iterator[tuple[str, str]]:
    """Upper-case names that a module defines, each with the docstring below it."""
    body = parsed(file).body
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
        for node in ast.walk(parsed(file))
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Load)
        for name in [node.id if isinstance(node, ast.Name) else node.attr]
        if name.isupper()
    )
    found = [(file, name) for file in FILES for name, _ in constants(file)]
    assert len(found) > 100
    assert [] == [(file, name) for file, name in found if not used[name]]


def test_numbers_stand_in_limits_alone() -> None:
    found = []
    for file in sorted((ROOT / "runtime" / "rulec_runtime").rglob("*.py")):
        name = ".".join(file.relative_to(ROOT / "runtime/rulec_runtime").with_suffix("").parts)
        if f".{name}".endswith((".limits", "__init__", "__main__")):
            continue
        if any(f"{name}.".startswith(f"{part}.") for part in " ".join(LAYOUT.values()).split()):
            continue
        module = importlib.import_module(f"rulec_runtime.{name}")
        for constant, _ in constants(file):
            value = getattr(module, constant)
            first = value[0] if isinstance(value, tuple) else value
            if isinstance(first, Real) and not isinstance(first, bool):
                found.append(f"{name}.{constant}")
    assert found == []
