"""Compile time of large plants, and where it goes."""

from __future__ import annotations

import gc
import math
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.passes.pipeline import PASSES, compile_plant, run_passes, without_collector
from rulec.passes.types import Compilation
from tests.bench.conftest import Results
from tests.bench.rigs import chain, side_by_side
from tests.conftest import ROOT, SOURCES

FAMILIES: dict[str, Callable[[int], str]] = {"chain": chain, "side by side": side_by_side}


def written(family: str, size: int, folder: Path) -> Path:
    (folder / "plant.yaml").write_text(FAMILIES[family](size), encoding="utf-8")
    return folder


def seconds_of_passes(plant: Path) -> tuple[dict[str, float], Ruleset]:
    """Processor time of each pass, which a busy machine distorts less than a clock."""
    compile_plant(ROOT / "plants" / "abc")
    gc.collect()
    known = Compilation(path=plant)
    found = {}
    with without_collector():
        for field, step in PASSES.items():
            begin = time.process_time()
            known = run_passes(known, field)
            found[step.__name__] = time.process_time() - begin
    return found, known.ruleset


KEYS = {"chain": "chain", "side by side": "side-by-side"}


def least_of_passes(plant: Path, rounds: int = 2) -> tuple[dict[str, float], Ruleset]:
    """The quickest of several: module types are differentiated in the first, and others on the
    machine make it longer, never shorter."""
    return min((seconds_of_passes(plant) for _ in range(rounds)), key=lambda r: sum(r[0].values()))


STEPS = {"chain": (50, 100, 200, 400), "side by side": (50, 200, 1000)}


@pytest.mark.parametrize("family", FAMILIES)
def test_growth(family: str, tmp_path: Path, results: Results) -> None:
    """Processor time per module and per rule, and how much each pass grows per module."""
    table = {}
    for size in STEPS[family]:
        folder = tmp_path / str(size)
        folder.mkdir()
        plant = written(family, size, folder)
        table[size] = found, made = least_of_passes(plant)
        total = sum(found.values())
        what = f"{family}, {len(made.modules)} modules, {len(made.cells)} rules"
        results.add(what, total, "s", key=f"{KEYS[family]}.{size}.seconds")
        results.add("    per module", 1e3 * total / len(made.modules), "ms")
        results.add("    per rule", 1e6 * total / len(made.cells), "us")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    what = f"{family}, up to {STEPS[family][-1]} modules: peak memory"
    results.add(what, peak, "MB", 1000.0, f"{KEYS[family]}.memory")
    abc = sum(least_of_passes(ROOT / "plants" / "abc", 5)[0].values())
    for size, (found, _) in table.items():
        goal = {("chain", 200): 15.0}.get((family, size))
        ratio = sum(found.values()) / abc
        key = f"{KEYS[family]}.{size}.times-abc"
        results.add(f"{family}, {size} modules, against plant abc", ratio, "", goal, key)
    small, large = (table[size] for size in (STEPS[family][0], STEPS[family][-1]))
    times = sum(large[0].values()) / sum(small[0].values())
    modules = len(large[1].modules) / len(small[1].modules)
    power = math.log(times) / math.log(modules)
    results.add(f"{family}: exponent of growth", power, "", key=f"{KEYS[family]}.power")
    for name in large[0]:
        if large[0][name] > 0.5:
            ratio = large[0][name] / len(large[1].modules) / small[0][name]
            results.add(
                f"    {name}: per module, against the smallest", ratio * len(small[1].modules), ""
            )


ALONE = """
import resource, sys, time
from pathlib import Path
from rulec.passes.pipeline import compile_plant
compile_plant(Path(sys.argv[1]))
begin = time.process_time()
text = compile_plant(Path(sys.argv[2])).to_json()
seconds = time.process_time() - begin
print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, len(text) / 1e6)
"""


def test_alone(tmp_path: Path, results: Results) -> None:
    """Long chains compiled and written, each in a process of its own, against plant abc."""
    abc = ROOT / "plants" / "abc"
    plants = {"abc": abc}
    for size in (200, 1000):
        (tmp_path / str(size)).mkdir()
        plants[f"chain of {size}"] = written("chain", size, tmp_path / str(size))
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    first: list[float] = []
    seconds: dict[str, float] = {}
    for name, plant in plants.items():
        command = [sys.executable, "-c", ALONE, str(abc), str(plant)]
        ran = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
        found = [float(word) for word in ran.stdout.split()]
        first = first or found
        for what, unit, one, of_abc in zip(
            ("CPU time", "peak memory", "file"), ("s", "MB", "MB"), found, first, strict=True
        ):
            key = f"alone.{name.replace(' ', '-')}.{what.replace(' ', '-')}"
            results.add(f"{name}: {what}", one, unit, key=key)
            results.add("    against plant abc", one / of_abc, "")
        seconds[name] = found[0]
    grown = math.log(seconds["chain of 1000"] / seconds["chain of 200"]) / math.log(5.0)
    results.add("chain, from 200 to 1000 modules: exponent of growth", grown, "", key="alone.power")
