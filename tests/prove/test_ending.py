"""A run that is interrupted leaves no process and goes on; a folder of other things is refused."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rulec.cli import main
from rulec.prove.campaign import CASES, SEALS, unusable
from tests.conftest import SOURCES

FEW = ("--quick", "--only=stationary-1-clean--1", "--jobs=2")
PATIENCE = 60.0
NOBODY = 65534


def started(work: Path) -> subprocess.Popen[str]:
    """`rulec prove`, as from a terminal: interrupts are heard, also where these tests hear none."""
    return subprocess.Popen(
        [sys.executable, "-m", "rulec", "prove", *FEW, f"--keep={work}"],
        env={**os.environ, "PYTHONPATH": SOURCES},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def listed(column: str) -> list[list[str]]:
    """Number and one more column of every process."""
    words = ["ps", "-A", "-o", f"pid=,{column}="]
    table = subprocess.run(words, capture_output=True, text=True, check=True)
    return [line.split() for line in table.stdout.splitlines()]


def below(pid: int) -> set[int]:
    """Processes that a process started, and those that they started."""
    parents = [(int(a), int(b)) for a, b in listed("ppid")]
    found = {pid}
    while more := {a for a, b in parents if b in found} - found:
        found |= more
    return found - {pid}


def alive(pids: set[int]) -> set[int]:
    """Those that run; what ended and was not waited for does not."""
    return {int(a) for a, state in listed("stat") if not state.startswith("Z")} & pids


def waited(done: Callable[[], object], seconds: float = PATIENCE) -> bool:
    """Whether something came about in time."""
    until = time.monotonic() + seconds
    while not done() and time.monotonic() < until:
        time.sleep(0.1)
    return bool(done())


posix = pytest.mark.skipif(os.name != "posix", reason="signals are a POSIX matter")


@posix
@pytest.mark.parametrize(
    "number",
    [*(pytest.param(n, marks=pytest.mark.prove) for n in ("SIGINT", "SIGTERM")), "SIGKILL"],
)
def test_an_interrupt_leaves_no_process(number: str, tmp_path: Path) -> None:
    """Sent to the command alone, while its workers analyse; then the same command goes on."""
    with started(tmp_path) as run:
        # Tracker of its resources, two workers.
        assert waited(lambda: (tmp_path / CASES).exists() and len(below(run.pid)) >= 3)
        time.sleep(1.0)
        others = below(run.pid)
        os.kill(run.pid, getattr(signal, number))
        said = run.communicate(timeout=PATIENCE)[1]
    assert waited(lambda: not alive(others), 5.0), alive(others)
    assert "Traceback" not in said
    is_killed = number == "SIGKILL"
    assert is_killed or "rulec prove: interrupted; the same command goes on" in said
    assert run.returncode == (-signal.SIGKILL if is_killed else 130)
    if number == "SIGINT":
        with started(tmp_path) as again:
            said = again.communicate(timeout=3 * PATIENCE)[1]
        assert (0, True) == (again.returncode, "answers sealed" in said)


@pytest.mark.parametrize(
    ("path", "code", "text"),
    [
        ("", 2, "a file is in the way"),
        (SEALS + "/notes", 2, "a run has a file there"),
        (SEALS, 1, "holds another run"),
        (CASES, 2, "a run has a folder there"),
        (CASES + "/mine", 2, "no run of rulec prove left it"),
    ],
)
def test_a_folder_with_something_in_the_way(
    path: str, code: int, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line with place and remedy, and everything stays, also what is not even text. What lies
    beside a run, such as its page, does not matter."""
    work, mine = tmp_path / "folder", b"\xff mine"
    file = work / path if path else work
    (tmp_path / "log.txt").touch()
    assert unusable(tmp_path) is None
    assert unusable(tmp_path / "new" / "folder") is None
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(mine)
    before = sorted(tmp_path.rglob("*"))
    assert code == main(["prove", *FEW, f"--keep={work}"])
    said = capsys.readouterr().err
    assert f"--keep: {work}" in said
    assert text in said
    assert said.endswith("; name another folder\n")
    assert (before, mine) == (sorted(tmp_path.rglob("*")), file.read_bytes())


@pytest.fixture
def closed() -> Iterator[Path]:
    """A folder that this process, for whom permissions hold for once, may not write to."""
    if not hasattr(os, "geteuid"):
        pytest.skip("permissions are a POSIX matter")
    user = os.geteuid()
    with tempfile.TemporaryDirectory() as name:
        os.chmod(name, 0o555)
        if user == 0:
            os.seteuid(NOBODY)
        yield Path(name)
        os.seteuid(user)
        os.chmod(name, 0o755)


def test_a_folder_that_cannot_be_written_to(closed: Path) -> None:
    """The folder itself, and one to be made in it."""
    for work in (closed, closed / "new"):
        why = "cannot write there (Permission denied); name another folder"
        assert f"--keep: {work}: {why}" == unusable(work)
