"""Fixtures that several test files share."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.language import document
from rulec.passes.pipeline import compile_plant

os.environ["RULEC_CHECKS"] = "1"

ROOT = Path(__file__).resolve().parent.parent
SOURCES = os.pathsep.join([str(ROOT), str(ROOT / "runtime")])
"""PYTHONPATH of a process that runs what stands here, whatever is installed."""

LONGEST = (
    "tests/figures/test_quick.py",
    "tests/runtime/mismatch/test_answers.py",
    "tests/prove/test_campaign.py",
    "tests/hostile/test_hostile.py",
    "tests/test_docs.py",
    "tests/test_errors.py",
    "tests/runtime/test_dynamic_diagnose.py",
    "tests/test_adopt.py",
    "tests/states/",
    "tests/rig/",
    "tests/prove/",
    "tests/runtime/",
    "tests/test_study.py",
)
"""Whose tests take longest comes first: no process waits for another in the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def rank(item: pytest.Item) -> int:
        file = item.path.relative_to(ROOT).as_posix()
        return next((i for i, name in enumerate(LONGEST) if file.startswith(name)), len(LONGEST))

    items.sort(key=rank)


@pytest.fixture(scope="session", autouse=True)
def _each_text_parsed_once() -> Iterator[None]:
    """The same text under the same name is the same document: most of the time of a check, and
    half of that of compiling a small plant, goes into reading the knowledge base again."""
    with pytest.MonkeyPatch.context() as patch:
        once = functools.lru_cache(maxsize=400)(document.parse_document)
        patch.setattr(document, "parse_document", once)
        yield


@functools.cache
def compiled(plant: str) -> Ruleset:
    """A shipped plant, compiled once per test run."""
    return compile_plant(ROOT / "plants" / plant)


def recordings_folder() -> Path:
    """Folder of the real recordings, which are not part of the project."""
    return Path(os.environ.get("RULEC_RECORDINGS", ROOT.parent / "shared" / "recordings"))


@pytest.fixture(scope="session")
def abc() -> Ruleset:
    """The plant of the seed paper's Figure 1."""
    return compiled("abc")
