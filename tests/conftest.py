"""Fixtures that several test files share."""

import atexit
import functools
import gc
import os
import shutil
import tempfile
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml
from rulec_runtime.contract.ruleset import Ruleset

from rulec.knowledge import check_knowledge
from rulec.knowledge.check_effect import EffectReader
from rulec.knowledge.check_module import ModuleReader
from rulec.language.diagnostics import Diagnostic
from rulec.language.reader import Reader
from rulec.passes.pipeline import compile_plant

os.environ["RULEC_CHECKS"] = "1"

gc.set_threshold(50_000, 20, 5)
"""What is read once stays to the end: with Python's usual thresholds a tenth of the time goes into
looking through it for garbage."""

if "PYTEST_XDIST_WORKER" not in os.environ:
    # Compiled plants are kept for this run alone, and for all its processes: never in the folder of
    # the user, nor from a run of other code.
    os.environ["RULEC_CACHE"] = tempfile.mkdtemp(prefix="rulec-tests-")
    atexit.register(shutil.rmtree, os.environ["RULEC_CACHE"], ignore_errors=True)

Capsys = pytest.CaptureFixture[str]
Patch = pytest.MonkeyPatch
Folders = pytest.TempPathFactory

Things = tuple[tuple[object, ...], list[Diagnostic]]
"""What something is read from, and the mistakes found so far."""
ROOT = Path(__file__).resolve().parent.parent
SOURCES = os.pathsep.join([str(ROOT), str(ROOT / "runtime")])
"""PYTHONPATH of a process that runs what stands here, whatever is installed."""

LONGEST = (
    "tests/live/",
    "tests/test_docs.py",
    "tests/runtime/mismatch/test_answers.py",
    "tests/figures/test_ledger.py",
    "tests/prove/test_campaign.py",
    "tests/runtime/mismatch/test_experiment.py",
    "tests/hostile/test_hostile.py",
    "tests/test_errors.py",
    "tests/runtime/mismatch/test_structure.py",
    "tests/runtime/test_dynamic_diagnose.py",
    "tests/test_adopt.py",
    "tests/states/",
    "tests/rig/",
    "tests/prove/",
    "tests/runtime/",
    "tests/test_study.py",
)
"""What waits for others comes first, while types are checked beside; then whose tests take longest:
no process waits for another in the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def rank(item: pytest.Item) -> int:
        file = item.path.relative_to(ROOT).as_posix()
        return next((i for i, name in enumerate(LONGEST) if file.startswith(name)), len(LONGEST))

    items.sort(key=rank)


def pytest_collection_finish() -> None:
    gc.freeze()  # modules and tests are no garbage


@pytest.fixture(scope="session", autouse=True)
def _each_text_read_once() -> Iterator[None]:
    """The same document means the same effect, fault, sensor and module type: most of the time of a
    check goes into reading the knowledge base again."""
    cache = _Cache()
    with pytest.MonkeyPatch.context() as patch:

        def once(owner: Any, name: str, things: Callable[..., Things]) -> None:
            read = getattr(owner, name)
            patch.setattr(owner, name, lambda *of: cache.of(*things(*of), lambda: read(*of)))

        def read_by(reader: Reader, others: Iterable[object] = ()) -> Things:
            return (reader.document, reader.units, *others), reader.found

        once(check_knowledge, "table_of", lambda lists, found: (tuple(lists), found))
        once(check_knowledge, "check_fault", read_by)
        once(check_knowledge, "_sensor", lambda of, faults: read_by(of, faults.values()))
        once(EffectReader, "read", read_by)
        once(
            ModuleReader,
            "read",
            lambda of: read_by(of, (*of.sensors.values(), *of.faults.values())),
        )
        yield


class _Cache:
    """What was read from the very same things without finding a mistake in them."""

    def __init__(self) -> None:
        self._results: OrderedDict[tuple[int, ...], tuple[tuple[object, ...], Any]] = OrderedDict()

    def of(
        self, things: tuple[object, ...], found: list[Diagnostic], read: Callable[[], Any]
    ) -> Any:
        """Read, or recall. The things are kept with their ids, so that no others get these."""
        key = tuple(map(id, things))
        if key not in self._results:
            before, given = len(found), read()
            if len(found) > before:
                return given
            self._results[key] = things, given
        self._results.move_to_end(key)
        if len(self._results) > 2000:
            self._results.popitem(last=False)
        return self._results[key][1]


def plain_yaml(file: Path) -> Any:
    """Data of a file of the project, by libyaml: ten times as fast where many are read."""
    return yaml.load(file.read_bytes(), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))


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


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """`rulec prove` works on its cases here, one after the other: processes take longer to start.
    With its workers it runs in tests/prove."""
    from rulec.prove import campaign

    def here(
        workers: object,
        what: str,
        work: Callable[..., Any],
        todo: Sequence[tuple[Any, ...]],
        done: int = 0,
    ) -> list[Any]:
        return [work(*words) for words in todo]

    monkeypatch.setattr(campaign.Workers, "each", here)
