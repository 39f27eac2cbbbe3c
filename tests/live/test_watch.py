"""`watch` as a process: killed at any moment, it tells everything, and nothing twice."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Any

from rulec_runtime.live.journal.store import open_journal

from tests.conftest import ROOT
from tests.live.journal.events import kept_in

LEAKAGE = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"


def watching(rules: Path, *options: str) -> list[str]:
    return [sys.executable, "-m", "rulec_runtime", "watch", str(rules), *options]


def environment() -> dict[str, str]:
    path = os.pathsep.join([str(ROOT), str(ROOT / "runtime")])
    return {**os.environ, "PYTHONPATH": path}


def run(rules: Path, *options: str, **more: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        watching(rules, *options),
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
        timeout=60,
        **more,
    )


def events_in(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def test_a_file_to_its_end(rules: Path, tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    options = ("--source", str(LEAKAGE), "--until-end", "--events", str(file))
    done = run(rules, *options, "--state", str(tmp_path / "state"))
    assert done.returncode == 0, done.stderr
    assert "began A.leakage 0.600" in done.stdout
    first = events_in(file)
    assert [e["number"] for e in first] == list(range(1, len(first) + 1))
    again = run(rules, *options, "--state", str(tmp_path / "state"))
    assert again.returncode == 0, again.stderr
    assert events_in(file) == first


def test_a_journal_keeps_events_and_state(rules: Path, tmp_path: Path) -> None:
    where = str(tmp_path / "plant.journal")
    options = ("--source", str(LEAKAGE), "--until-end", "--journal", where)
    for _ in range(2):
        done = run(rules, *options)
        assert done.returncode == 0, done.stderr
    assert "began" not in done.stdout
    with closing(open_journal(where)) as journal:
        numbers = [one.event.number for one in journal.events("abc")]
        saved = kept_in(journal)
    assert sorted(numbers) == list(range(1, 8))
    assert saved[0] == 7


def test_standard_input(rules: Path) -> None:
    done = run(rules, "--source", "-", input=LEAKAGE.read_text(encoding="utf-8"))
    assert done.returncode == 0, done.stderr
    assert "began A.leakage 0.600" in done.stdout


def test_kill_at_any_moment(rules: Path, tmp_path: Path) -> None:
    """The logger writes on; each time the process is killed it goes on where it was."""
    lines = LEAKAGE.read_text(encoding="utf-8").splitlines(keepends=True)
    log, file = tmp_path / "log.csv", tmp_path / "events.jsonl"
    log.write_text("".join(lines[:12]), encoding="utf-8")
    options = ("--source", str(log), "--events", str(file), "--state", str(tmp_path / "state"))
    for step in range(3):
        process = subprocess.Popen(
            watching(rules, *options), env=environment(), stdout=subprocess.DEVNULL
        )
        with log.open("a", encoding="utf-8") as out:
            out.writelines(lines[12 + 20 * step : 32 + 20 * step])
        time.sleep(1.0 + 0.4 * step)
        process.send_signal(signal.SIGKILL)
        process.wait()
    with log.open("a", encoding="utf-8") as out:
        out.writelines(lines[72:])
    done = run(rules, *options, "--until-end")
    assert done.returncode == 0, done.stderr
    told = events_in(file)
    assert [e["number"] for e in told] == list(range(1, len(told) + 1))
    faults = [(e["what"], e["episode"]["since"]) for e in told if e["episode"]["kind"] == "fault"]
    for what in ("began", "ended"):
        assert [since for told_as, since in faults if told_as == what] == [11.0, 31.0, 51.0]
