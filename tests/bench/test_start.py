"""What an operator waits for before anything happens."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.bench.conftest import Results
from tests.bench.start import GOAL, measured
from tests.conftest import ROOT, SOURCES, compiled

EXAMPLE = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"


def seconds(*arguments: str, rounds: int = 9) -> float:
    """Median wall time of a process."""
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        call = [sys.executable, *arguments]
        subprocess.run(call, check=True, capture_output=True, env=environment)
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


@pytest.mark.parametrize("verb", ["diagnose", "compile"])
def test_help(verb: str, results: Results) -> None:
    """`rulec VERB --help`; beside it Python alone."""
    results.add("start: python alone", seconds("-c", "pass"), "s")
    results.add(f"start: rulec {verb} --help", seconds("-m", "rulec", verb, "--help"), "s", 0.2)


def test_second_start_on_a_plant(tmp_path: Path, results: Results) -> None:
    """Processor time until the real work begins, where the compiled plant is kept."""
    for name, found in measured(tmp_path).items():
        results.add(f"start: rulec {name}", found, "s CPU", GOAL)


def test_diagnose_with_a_ruleset(tmp_path: Path, results: Results) -> None:
    """The shipped example, 80 samples, from start to exit."""
    file = tmp_path / "abc.ruleset.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    whole = seconds("-m", "rulec", "diagnose", str(file), str(EXAMPLE))
    results.add("process: diagnose 80 samples with a ruleset", whole, "s")
