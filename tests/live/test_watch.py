"""`watch` as a process: killed at any moment, it tells everything, and nothing twice."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.conftest import ROOT, SOURCES

LEAKAGE = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
LINES = LEAKAGE.read_text(encoding="utf-8").splitlines(keepends=True)


RUNTIME = ("-m", "rulec_runtime")


def watching(rules: Path, *options: str, program: Sequence[str] = RUNTIME) -> list[str]:
    return [sys.executable, *program, "watch", str(rules), *options]


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": SOURCES}


@contextmanager
def watched(
    rules: Path, *options: str, program: Sequence[str] = RUNTIME
) -> Iterator[subprocess.Popen[str]]:
    """A watch that runs, killed at the end if it still lives."""
    process = subprocess.Popen(
        watching(rules, *options, program=program),
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def until(true: Callable[[], Any]) -> Any:
    """What it gives as soon as it is true; fails after 20 s."""
    ends = time.monotonic() + 20.0
    while not (found := true()):
        assert time.monotonic() < ends
        time.sleep(0.02)
    return found


def add(log: Path, low: int, high: int) -> None:
    """Some more lines of the leakage."""
    with log.open("a", encoding="utf-8") as out:
        out.writelines(LINES[low:high])


def test_standard_input(rules: Path) -> None:
    command, text = watching(rules, "--source", "-"), "".join(LINES)
    told = subprocess.check_output(command, input=text, env=environment(), text=True, timeout=60)
    assert "began A.leakage 0.600" in told


def test_kill_at_any_moment(rules: Path, tmp_path: Path) -> None:
    """The logger writes on; each time the process is killed, as soon as it has told something, it
    goes on where it was. Once all is told, nothing is told again."""
    log, file = tmp_path / "log.csv", tmp_path / "events.jsonl"
    file.touch()
    add(log, 0, 12)
    options = ("--source", str(log), "--events", str(file), "--state", str(tmp_path / "state"))
    for low, high in ((12, 32), (32, 52), (52, 72)):
        before = file.stat().st_size
        with watched(rules, *options):
            add(log, low, high)
            until(lambda size=before: file.stat().st_size > size)  # type: ignore[misc]
    add(log, 72, len(LINES))
    for _ in range(2):
        subprocess.run(watching(rules, *options, "--until-end"), env=environment(), check=True)
    told = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    assert [e["number"] for e in told] == list(range(1, len(told) + 1))
    faults = [(e["what"], e["episode"]["since"]) for e in told if e["episode"]["kind"] == "fault"]
    for what in ("began", "ended"):
        assert [since for told_as, since in faults if told_as == what] == [11.0, 31.0, 51.0]


WATCH = """
import signal
import sys
from rulec_runtime.live import limits

if __name__ == "__main__":
    # Whoever runs the tests in the background has interrupts ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    limits.SMALL_PLANT = 5
    from rulec_runtime.cli import main

    raise SystemExit(main(sys.argv[1:]))
"""


def looks_of(pid: int) -> list[int]:
    """Processes that one has started for looks."""
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(c) for c in listed if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]


def holds_interrupts(pid: int) -> bool:
    """Is a process still starting another one?"""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    (mask,) = [int(line.split()[1], 16) for line in lines if line.startswith("SigBlk:")]
    return bool(mask >> (signal.SIGINT - 1) & 1)


def test_an_interrupt_waits_for_no_look(rules: Path, tmp_path: Path) -> None:
    """While a look at everything goes on beside the rows, and never ends."""
    log, script = tmp_path / "log.csv", tmp_path / "watch.py"
    script.write_text(WATCH, encoding="utf-8")
    add(log, 0, 5)
    with watched(rules, "--source", str(log), program=[str(script)]) as watch:
        row, started = 5, list[int]()
        while not started and row < len(LINES):
            add(log, row, row + 1)
            row += 1
            time.sleep(0.2)
            started = looks_of(watch.pid)
        (look,) = started
        # Interrupted while it starts one, the watch would end before it is asked for anything.
        until(lambda: not holds_interrupts(watch.pid))
        os.kill(look, signal.SIGSTOP)
        since = time.monotonic()
        watch.send_signal(signal.SIGINT)
        told, _ = watch.communicate(timeout=10)
        assert time.monotonic() - since < 3.0
        assert watch.returncode == 0, told
        assert "Traceback" not in told
        assert not Path(f"/proc/{look}").exists()
