"""Fixtures that several test files share."""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import tempfile
from collections import OrderedDict
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.knowledge import read_layers
from rulec.language import document, schema
from rulec.language.diagnostics import Diagnostic
from rulec.language.document import Document
from rulec.passes.pipeline import compile_plant

os.environ["RULEC_CHECKS"] = "1"

if "PYTEST_XDIST_WORKER" not in os.environ:
    # Compiled plants are kept for this run alone, and for all its processes: never in the folder of
    # the user, nor from a run of other code.
    os.environ["RULEC_CACHE"] = tempfile.mkdtemp(prefix="rulec-tests-")
    atexit.register(shutil.rmtree, os.environ["RULEC_CACHE"], ignore_errors=True)

ROOT = Path(__file__).resolve().parent.parent
SOURCES = os.pathsep.join([str(ROOT), str(ROOT / "runtime")])
"""PYTHONPATH of a process that runs what stands here, whatever is installed."""

LONGEST = (
    "tests/test_docs.py",
    "tests/runtime/mismatch/test_answers.py",
    "tests/figures/test_quick.py",
    "tests/prove/test_campaign.py",
    "tests/runtime/mismatch/test_experiment.py",
    "tests/hostile/test_hostile.py",
    "tests/test_errors.py",
    "tests/runtime/mismatch/test_clock_shift.py",
    "tests/runtime/test_dynamic_diagnose.py",
    "tests/test_adopt.py",
    "tests/live/",
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
def _each_text_read_once() -> Iterator[None]:
    """The same text under the same name is the same document, and keeps to its schema or not: most
    of the time of a check, and half of that of compiling a small plant, goes into reading the
    knowledge base again."""
    with pytest.MonkeyPatch.context() as patch:
        once = functools.lru_cache(maxsize=400)(document.parse_document)
        patch.setattr(document, "parse_document", once)
        patch.setattr(read_layers, "check_schema", _checked_once(schema.check_schema))
        yield


def _checked_once(check: Callable[..., list[Diagnostic]]) -> Callable[..., list[Diagnostic]]:
    """A check of a schema that keeps what it said of the last documents; these are not hashable."""
    kept: OrderedDict[tuple[object, ...], tuple[Document, list[Diagnostic]]] = OrderedDict()

    def checked(of: Document, *rest: object) -> list[Diagnostic]:
        # The document is kept with its id, so that no other gets it.
        key = (id(of), *rest)
        if key not in kept:
            kept[key] = of, check(of, *rest)
        kept.move_to_end(key)
        if len(kept) > 400:
            kept.popitem(last=False)
        return list(kept[key][1])

    return checked


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
