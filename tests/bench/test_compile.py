"""Compile time of large plants, and where it goes."""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from rulec.pipeline import PASSES, compile_plant
from runtime.ruleset import Ruleset
from tests.bench.conftest import Results
from tests.bench.rigs import chain, side_by_side
from tests.conftest import ROOT

SIZES = (10, 50, 200)
GOALS = {50: 2.0, 200: 10.0}
FAMILIES: dict[str, Callable[[int], str]] = {"chain": chain, "side by side": side_by_side}


def written(family: str, size: int, folder: Path) -> Path:
    (folder / "plant.yaml").write_text(FAMILIES[family](size), encoding="utf-8")
    return folder


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("family", FAMILIES)
def test_compile(
    family: str, size: int, tmp_path: Path, benchmark: BenchmarkFixture, results: Results
) -> None:
    """The whole of `compile_plant`, module types differentiated before (a second compile)."""
    plant = written(family, size, tmp_path)
    compile_plant(ROOT / "plants" / "abc")
    made: Ruleset = benchmark.pedantic(compile_plant, (plant,), rounds=1 if size > 100 else 3)
    seconds = statistics.median(benchmark.stats.stats.data)
    what = f"compile {size} modules, {family} ({len(made.cells)} rules)"
    results.add(what, seconds, "s", GOALS.get(size))
    results.add("    per rule", 1e6 * seconds / len(made.cells), "us")
    assert not made.unobserved


@pytest.mark.parametrize("family", FAMILIES)
def test_growth(family: str, tmp_path: Path, results: Results) -> None:
    """Exponent of time over modules and over rules, from 50 to 150 modules."""
    points = []
    for size in (50, 150):
        plant = written(family, size, tmp_path)
        begin = time.perf_counter()
        made = compile_plant(plant)
        points.append((size, len(made.cells), time.perf_counter() - begin))
    (m1, r1, t1), (m2, r2, t2) = points
    results.add(f"growth, {family}: time ~ modules^", math.log(t2 / t1) / math.log(m2 / m1), "")
    results.add(f"growth, {family}: time ~ rules^", math.log(t2 / t1) / math.log(r2 / r1), "")


def test_passes(tmp_path: Path, results: Results) -> None:
    """Seconds of each pass for a chain of 100 modules."""
    result: Any = written("chain", 100, tmp_path)
    for step in PASSES:
        begin = time.perf_counter()
        result = step(result)
        results.add(f"pass {step.__name__}, chain of 100", time.perf_counter() - begin, "s")


@pytest.mark.parametrize("size", SIZES[:2])
def test_whole_process(size: int, tmp_path: Path, results: Results) -> None:
    """`rulec compile` from a shell, imports, differentiation and writing included."""
    plant = written("chain", size, tmp_path)
    command = [sys.executable, "-m", "rulec", "compile", str(plant), "-o", str(tmp_path / "r.json")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True, env=environment)
        times.append(time.perf_counter() - begin)
    results.add(f"process: compile {size} modules", statistics.median(times), "s")
