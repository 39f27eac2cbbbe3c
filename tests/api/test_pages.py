"""The page and the notebook on the use from Python: all their code runs."""

from __future__ import annotations

import ast
import doctest
import json
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import ROOT

DOCS = ROOT / "docs"


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def test_the_page_shows_what_happens() -> None:
    """Every line below a prompt is what Python says."""
    flags = doctest.ELLIPSIS
    page = str(DOCS / "use-from-python.md")
    failed, tried = doctest.testfile(page, module_relative=False, optionflags=flags)
    assert 0 == failed
    assert tried > 10


def test_the_notebook_runs() -> None:
    """Every code cell, in order; what a cell shows is HTML for a notebook."""
    shown = outputs_of(DOCS / "rulec-from-python.ipynb")
    assert all(hasattr(part, "_repr_html_") for part in shown)
    pages = [str(part._repr_html_()) for part in shown]
    assert 7 == len(pages)
    assert any("A: the pump delivers 20 % less than its law says" in page for page in pages)
    assert "The columns B.dp and C.dp are swapped" in pages[-2]


def outputs_of(file: Path) -> list[Any]:
    """What the cells of a notebook show: the value of the last line, where that is one."""
    known: dict[str, Any] = {}
    shown = []
    for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert [] == cell["outputs"]
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, file.name, "exec"), known)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), file.name, "eval"), known))
    return shown
