"""Golden rulesets: a refactor leaves them byte-identical. Re-made only by `make golden`."""

import os
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset_file import read_ruleset

from tests.conftest import compiled

GOLDEN = Path(__file__).parent / "golden"


@pytest.mark.parametrize("plant", ["abc", "zema-hydraulic"])
def test_ruleset_is_as_reviewed(plant: str) -> None:
    """The compiled ruleset equals the reviewed one, which reads back to it."""
    text = compiled(plant).to_json()
    file = GOLDEN / f"{plant}.json"
    if os.environ.get("RULEC_REMAKE"):
        file.write_text(text, encoding="utf-8")
    assert file.read_text(encoding="utf-8") == text
    assert compiled(plant) == read_ruleset(file)
