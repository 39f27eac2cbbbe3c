"""`watch` as a process: killed at any moment, it tells everything, and nothing twice."""

import dataclasses
import json
import os
import random
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.cli import main
from rulec_runtime.output.terminal import is_shown

from tests.conftest import ROOT, SOURCES, Capsys, compiled
from tests.live.sources.taking import mutated

LEAKAGE = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
LINES = LEAKAGE.read_text(encoding="utf-8").splitlines(keepends=True)


def watching(rules: Path, *options: str) -> list[str]:
    return [sys.executable, "-m", "rulec_runtime", "watch", str(rules), *options]


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": SOURCES}


@contextmanager
def watched(rules: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A watch that runs, killed at the end if it still lives."""
    process = subprocess.Popen(
        watching(rules, *options),
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
    output = subprocess.check_output(command, input=text, env=environment(), text=True, timeout=60)
    assert "began A.leakage 0.600" in output


@pytest.mark.parametrize(
    ("place", "stamp", "said", "when"),
    [
        ("Europe/Berlin", "2026-10-25 02:59:{:02d}", ", times in Europe/Berlin", "02:59:11"),
        ("Europe/Berlin", "2026-07-01 12:00:{:02d}Z", ", times in Europe/Berlin", "14:00:11"),
        ("", "2026-07-01 12:00:{:02d}+02:00", "7 of 7 signals; times in UTC", "10:00:11"),
        ("", "2026-07-01 12:00:{:02d}", "7 of 7 signals\n", "12:00:11"),
    ],
)
def test_times_are_those_of_the_clocks_of_the_plant(
    place: str, stamp: str, said: str, when: str, tmp_path: Path, capsys: Capsys
) -> None:
    """As in the diagnosis of the same file; where no zone is known and the stamps have one, UTC."""
    rows = [line.split(",", 1)[1] for line in LINES[1:26]]
    log = tmp_path / "log.csv"
    log.write_text(LINES[0].replace("time [s]", "time"), encoding="utf-8")
    with log.open("a", encoding="utf-8") as out:
        out.writelines(f"{stamp.format(i)},{row}" for i, row in enumerate(rows))
    ruleset = dataclasses.replace(compiled("abc"), time_zone=place)
    (tmp_path / "zoned.json").write_text(ruleset.to_json(), encoding="utf-8")
    options = ("--source", str(log), "--until-end")
    assert main(["watch", str(tmp_path / "zoned.json"), *options]) == 0
    told = capsys.readouterr().out
    assert said in told
    assert f"since {stamp[:10]} {when}; do:" in told


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
    events = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    assert [e["number"] for e in events] == list(range(1, len(events) + 1))
    faults = [(e["what"], e["episode"]["since"]) for e in events if e["episode"]["kind"] == "fault"]
    for what in ("began", "ended"):
        assert [since for told_as, since in faults if told_as == what] == [11.0, 31.0, 51.0]


def test_mutated_rows_do_no_harm(rules: Path, tmp_path: Path, capsys: Capsys) -> None:
    """Of the sound rows behind them all is told, and nothing that steers the terminal."""
    head, *rows = [line.encode() for line in LINES]
    draw, log = random.Random(9), tmp_path / "log.csv"
    harm = [mutated(row, draw) for row in (*rows, *rows)]
    sound = [b"%d,%s" % (2_000_000 + k, row.partition(b",")[2]) for k, row in enumerate(rows)]
    log.write_bytes(b"".join([head, *harm, b"\n", *sound]))
    assert main(["watch", str(rules), "--source", str(log), "--until-end"]) == 0
    said = capsys.readouterr()
    for what in ("began A.leakage 0.600", "ended A.leakage 0.600"):
        assert what in said.out
    assert all(is_shown(sign) or sign == "\n" for sign in said.out + said.err)
    assert "Traceback" not in said.err


def test_a_source_that_ends_without_a_row_is_no_success(
    rules: Path, tmp_path: Path, capsys: Capsys
) -> None:
    log = tmp_path / "log.csv"
    for text in ("", LINES[0]):
        log.write_text(text)
        assert main(["watch", str(rules), "--source", str(log), "--until-end"]) == 1
        assert "log.csv: it ended before a row that could be read" in capsys.readouterr().err
