"""The plants to begin with: each README tells what is wrong in its recording, and what is told."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from rulec.cli import main
from rulec.commands.check_files import collect
from tests.conftest import ROOT, compiled
from tests.page_steps import Typed, steps_of

PAGES = sorted((ROOT / "plants").glob("*/README.md"))
PLANTED = re.compile(r"^\*\*Planted:\*\* `(\S+)`", re.MULTILINE)

pytestmark = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.parent.name)


def test_a_plant_is_clean_and_compiles(page: Path) -> None:
    """Nothing to mend, nothing to doubt; as it was built it differs in values alone."""
    assert [] == collect([page.parent])
    assert page.parent.name == compiled(page.parent.name).plant


def test_a_readme_tells_what_diagnose_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One finding, which is what was planted or has it among the causes that fit."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", "120")
    (step,) = (step for step in steps_of(page) if isinstance(step, Typed))
    answer = tmp_path / "answer.json"
    assert 0 == main([*shlex.split(step.command)[1:], "--json", str(answer)])
    printed = _squeezed(capsys.readouterr().out)
    assert all(_squeezed(line) in printed for line in step.shown)
    (finding,) = json.loads(answer.read_text(encoding="utf-8"))["findings"]
    assert finding["fault"] in step.shown[0]
    others = [*finding["alternatives"], *finding["remote"]]
    planted = PLANTED.search(page.read_text(encoding="utf-8"))
    assert planted is not None
    assert planted[1] in {finding["fault"], *(other["fault"] for other in others)}


def _squeezed(text: str) -> str:
    return " ".join(text.split())
