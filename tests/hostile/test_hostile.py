"""No input hangs, crashes, steers the terminal or writes outside its folder."""

import contextlib
import csv
import io
import shutil
import signal
from functools import reduce
from pathlib import Path

import pytest

from rulec.cli import main
from tests.conftest import ROOT, compiled
from tests.hostile import file_cases, json_cases, recording_cases, yaml_cases
from tests.hostile.case import Case
from tests.hostile.texts import CANARY, SECRETS

CASES = [
    *yaml_cases.cases(),
    *recording_cases.cases(),
    *json_cases.cases(),
    *file_cases.cases(),
]

LIMIT = 10
"""Seconds of work after which an input counts as hanging. The slowest takes two on an idle machine;
what is refused takes less than one."""

WAITS = 60
"""Seconds on the clock after which it does so too, as when it waits for a pipe."""

PRECIOUS = SECRETS["a list of users"]


class Hangs(BaseException):
    """Raised from the outside; nothing in the tool catches it."""


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


def called(arguments: list[str]) -> tuple[int, str]:
    """Call `rulec`: its exit code and what it said. Any exception but argparse's is a crash."""

    def stop(number: int, frame: object) -> None:
        raise Hangs

    signals = (signal.SIGALRM, signal.SIGPROF)
    before = [signal.signal(number, stop) for number in signals]
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    signal.alarm(WAITS)
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = main(arguments)
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else -1
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)
    return code, said.getvalue()


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
    known = (("{rules}", str(rules)), ("{plants}", str(ROOT / "plants")))
    code, text = called([reduce(lambda a, k: a.replace(*k), known, a) for a in case.arguments])
    assert code in (0, 1, 2, 3)
    assert not {c for c in text if not (c.isprintable() or c in "\n\u00a0\u202f")}
    assert "Traceback" not in text
    assert CANARY not in text
    assert case.family != "paths" or "KB016" in text
    assert ["precious"] == [f.name for f in outside.iterdir()]
    assert (outside / "precious").read_text() == PRECIOUS
    assert {"inside", "outside"} == {f.name for f in tmp_path.iterdir()}
    given = {*case.files, *case.links, *case.odd}
    for file in inside.rglob("*"):
        if file.relative_to(inside).as_posix() not in given and file.is_file():
            assert CANARY.encode() not in file.read_bytes()
    assert [] == [f.name for f in inside.rglob("*.part") if f.name not in case.links]
    for file in inside.rglob("out.csv"):
        with file.open(encoding="utf-8", newline="") as stream:
            assert [] == [cell for row in csv.reader(stream) for cell in row if runs(cell)]


def runs(cell: str) -> bool:
    """Would a spreadsheet take this for a formula?"""
    if cell in ("", "-") or cell[0] not in "=+-@\t\r":
        return False
    try:
        float(cell)
    except ValueError:
        return True
    return False
