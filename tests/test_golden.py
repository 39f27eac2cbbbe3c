"""Golden rulesets: a refactor leaves them byte-identical. Re-made only by `make golden`."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset_file import read_ruleset

from tests.conftest import compiled

GOLDEN = Path(__file__).parent / "golden"
PLANTS = ("abc", "zema-hydraulic")


@pytest.mark.parametrize("plant", PLANTS)
def test_ruleset_is_as_reviewed(plant: str) -> None:
    """The compiled ruleset equals the reviewed one."""
    text = compiled(plant).to_json()
    file = GOLDEN / f"{plant}.json"
    if os.environ.get("RULEC_REMAKE"):
        file.write_text(text, encoding="utf-8")
    assert file.read_text(encoding="utf-8") == text


@pytest.mark.parametrize("plant", PLANTS)
def test_golden_ruleset_can_be_read(plant: str) -> None:
    """A written ruleset reads back to an equal one."""
    assert compiled(plant) == read_ruleset(GOLDEN / f"{plant}.json")
