"""No input hangs, crashes, steers the terminal or writes outside its folder."""

from __future__ import annotations

import collections
import contextlib
import csv
import io
import shutil
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from rulec.cli import main
from tests.conftest import ROOT, compiled
from tests.hostile import argument_cases, file_cases, json_cases, recording_cases, yaml_cases
from tests.hostile.case import Case
from tests.hostile.texts import CANARY, SECRETS

CASES = [
    *yaml_cases.cases(),
    *recording_cases.cases(),
    *json_cases.cases(),
    *argument_cases.cases(),
    *file_cases.cases(),
]

LIMIT = 10
"""Seconds of work after which an input counts as hanging. The slowest takes two on an idle machine;
what is refused takes less than one."""

WAITS = 60
"""Seconds on the clock after which it does so too, as when it waits for a pipe."""

LEAST, LEAST_FILES = 900, 250
"""Inputs of all families, and those that are hostile as files or name others."""

PRECIOUS = SECRETS["a list of users"]


class Hangs(BaseException):
    """Raised from the outside; nothing in the tool catches it."""


@dataclass(frozen=True)
class Outcome:
    """What a call gave."""

    code: int
    text: str
    seconds: float


@pytest.fixture(scope="module")
def rules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("rules") / "abc.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def knowledge(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The knowledge base without its effects: `check` reads all of it each time, and four fifths
    of that are effects, of which no file here speaks."""
    folder = tmp_path_factory.mktemp("knowledge") / "kb"
    return Path(shutil.copytree(ROOT / "kb", folder, ignore=shutil.ignore_patterns("effects")))


def called(arguments: list[str]) -> Outcome:
    """Call `rulec`; any exception but argparse's leaving is a crash."""

    def stop(number: int, frame: object) -> None:
        raise Hangs

    signals = (signal.SIGALRM, signal.SIGPROF)
    before = [signal.signal(number, stop) for number in signals]
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    signal.alarm(WAITS)
    out, err, start = io.StringIO(), io.StringIO(), time.perf_counter()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main(arguments)
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else -1
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)
    return Outcome(code, out.getvalue() + err.getvalue(), time.perf_counter() - start)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_refused_or_done_safely(
    case: Case, tmp_path: Path, rules: Path, knowledge: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    (outside / "precious").write_text(PRECIOUS)
    case.lay_out(inside)
    monkeypatch.chdir(inside)
    if case.arguments[0] == "check":
        monkeypatch.setenv("RULEC_KB", str(knowledge))
    known = {"{rules}": str(rules), "{plants}": str(ROOT / "plants")}
    arguments = list(case.arguments)
    for name, path in known.items():
        arguments = [a.replace(name, path) for a in arguments]
    outcome = called(arguments)
    assert outcome.code in (0, 1, 2, 3)
    odd = {c for c in outcome.text if not (c.isprintable() or c in "\n\u00a0\u202f")}
    assert not odd
    assert "Traceback" not in outcome.text
    assert CANARY not in outcome.text
    if case.family == "paths":
        assert "KB016" in outcome.text
    assert ["precious"] == [f.name for f in outside.iterdir()]
    assert (outside / "precious").read_text() == PRECIOUS
    assert {"inside", "outside"} == {f.name for f in tmp_path.iterdir()}
    given = {*case.files, *case.links, *case.odd}
    for file in inside.rglob("*"):
        if file.relative_to(inside).as_posix() not in given and file.is_file():
            assert CANARY.encode() not in file.read_bytes()
    left = [f.name for f in inside.rglob("*.part") if f.name not in case.links]
    assert left == []
    for file in inside.rglob("out.csv"):
        assert [] == [cell for cell in cells(file) if runs(cell)]


def cells(file: Path) -> Iterator[str]:
    with file.open(encoding="utf-8", newline="") as stream:
        for row in csv.reader(stream):
            yield from row


def runs(cell: str) -> bool:
    """Would a spreadsheet take this for a formula?"""
    if cell in ("", "-") or cell[0] not in "=+-@\t\r":
        return False
    try:
        float(cell)
    except ValueError:
        return True
    return False


def test_enough_of_each_family(record_property: pytest.RecordProperty) -> None:
    """Counts by family, each input once."""
    counts = collections.Counter(case.family for case in CASES)
    for family, count in sorted(counts.items()):
        record_property(family, count)
        print(f"{count:4} {family}")
    print(f"{len(CASES):4} in all")
    assert len({case.id for case in CASES}) == len(CASES) >= LEAST
    assert len(list(file_cases.cases())) >= LEAST_FILES
    assert min(counts.values()) >= 8
