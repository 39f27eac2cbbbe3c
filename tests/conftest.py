"""Fixtures that several test files share."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.passes.pipeline import compile_plant

os.environ["RULEC_CHECKS"] = "1"

ROOT = Path(__file__).resolve().parent.parent

LONG = ("tests/prove", "tests/runtime/mismatch", "tests/rig", "tests/runtime")
"""Folders whose tests take long come first: no process waits for another in the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def rank(item: pytest.Item) -> int:
        folder = item.path.relative_to(ROOT).as_posix()
        return next((i for i, name in enumerate(LONG) if folder.startswith(f"{name}/")), len(LONG))

    items.sort(key=rank)


@functools.cache
def compiled(plant: str) -> Ruleset:
    """A shipped plant, compiled once per test run."""
    return compile_plant(ROOT / "plants" / plant)


def recordings_folder() -> Path:
    """Folder of the real recordings, which are not part of the project."""
    return Path(os.environ.get("RULEC_RECORDINGS", ROOT.parent / "shared" / "recordings"))


@pytest.fixture
def abc() -> Ruleset:
    """The plant of the seed paper's Figure 1."""
    return compiled("abc")
