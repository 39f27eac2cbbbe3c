"""Every diagnostic code has a failing example, whose whole text is compared."""

from __future__ import annotations

import contextlib
import os
import random
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from rulec.commands.check import collect
from rulec.diagnostics import Refused, render_all
from rulec.document import MAX_BYTES
from rulec.pipeline import compile_plant
from tests.conftest import ROOT

ERRORS = Path("tests/errors")
EXAMPLES = sorted(f.name for f in (ROOT / ERRORS).iterdir() if f.is_dir())
MEANINGS = dict(
    line.split(" ", 1)
    for line in (ROOT / ERRORS / "meanings.txt").read_text(encoding="utf-8").splitlines()
)
TOO_LARGE = "KB002-too-large"


@pytest.fixture(autouse=True)
def _at_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths in the expected texts are relative to the project folder."""
    monkeypatch.chdir(ROOT)
    monkeypatch.delenv("RULEC_KB", raising=False)


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_says_what_is_expected(name: str) -> None:
    """One mistake gives one diagnostic, with exactly this text."""
    with _input(name):
        text = _text_of(ERRORS / name)
    expected = ERRORS / name / "expected.txt"
    if os.environ.get("RULEC_REMAKE"):
        expected.write_text(text, encoding="utf-8")
    assert expected.read_text(encoding="utf-8") == text
    assert [name[:5]] == re.findall(r"^KB\d{3}", text, re.MULTILINE)
    assert text.endswith("\n1 mistake in 1 file\n")


@contextlib.contextmanager
def _input(name: str) -> Iterator[None]:
    """The one example that is too large to keep is written for the moment."""
    if name != TOO_LARGE:
        yield
        return
    file = ERRORS / name / "module.yaml"
    file.write_text("# a log file, named .yaml by mistake\n" * (MAX_BYTES // 30), encoding="utf-8")
    yield
    file.unlink()


def _text_of(folder: Path) -> str:
    """What `rulec check` prints, or `rulec compile` where only that finds the mistake."""
    found = collect([folder])
    if not found:
        with pytest.raises(Refused) as refused:
            compile_plant(folder)
        found = list(refused.value.diagnostics)
    return render_all(found) + "\n"


def test_every_code_has_an_example_and_a_meaning() -> None:
    """Codes in the sources, examples and meanings are the same."""
    sources = (file.read_text(encoding="utf-8") for file in (ROOT / "rulec").rglob("*.py"))
    used = {code for text in sources for code in re.findall(r"KB\d{3}", text)}
    assert used == {name[:5] for name in EXAMPLES}
    assert used == set(MEANINGS)


def test_page_of_errors_is_up_to_date() -> None:
    """docs/errors.md is made from the examples."""
    page = ROOT / "docs" / "errors.md"
    text = _page()
    if os.environ.get("RULEC_REMAKE"):
        page.write_text(text, encoding="utf-8")
    assert page.read_text(encoding="utf-8") == text


def _page() -> str:
    """One section per code: its meaning, and each example as it is printed."""
    lines = [
        "# Errors",
        "",
        "What `rulec check` says, by code. This page is made from the examples in `tests/errors/`",
        "(`RULEC_REMAKE=1 pytest tests/test_errors.py`); do not edit it.",
    ]
    for code, meaning in MEANINGS.items():
        lines += ["", f"## {code}", "", meaning]
        for name in EXAMPLES:
            if name.startswith(code):
                text = (ERRORS / name / "expected.txt").read_text(encoding="utf-8")
                lines += ["", "```text", *text.splitlines()[:-1], "```"]
    return "\n".join(lines) + "\n"
