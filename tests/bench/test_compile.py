"""Compile time and memory of large plants."""

import math
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from rulec.passes.pipeline import compile_plant
from tests.bench.conftest import Add
from tests.bench.rigs import chain, side_by_side
from tests.bench.row import least
from tests.conftest import ROOT, SOURCES

ABC = ROOT / "plants" / "abc"
FAMILIES: Mapping[str, tuple[Callable[[int], str], tuple[int, ...]]] = {
    "chain": (chain, (50, 100, 200, 400)),
    "side-by-side": (side_by_side, (50, 200, 1000)),
}


def written(text: str, folder: Path) -> Path:
    folder.mkdir()
    (folder / "plant.yaml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("family", FAMILIES)
def test_growth(family: str, tmp_path: Path, add: Add) -> None:
    """Processor time, against that of plant abc, and how it grows."""
    make, sizes = FAMILIES[family]
    abc, found = least(lambda: compile_plant(ABC), 6), []
    for size in sizes:
        plant = written(make(size), tmp_path / str(size))
        # In the first of two rounds module types are differentiated.
        found.append(least(lambda plant=plant: compile_plant(plant), 2))
        add(f"{family}, {size} modules", found[-1], "s")
        goal = {("chain", 200): 15.0}.get((family, size))
        key = f"{family}.{size}.times-abc"
        add("    against plant abc", found[-1] / abc, "", goal, key)
    power = math.log(found[-1] / found[0]) / math.log(sizes[-1] / sizes[0])
    add(f"{family}: exponent of growth", power, "")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    add(f"{family}, up to {sizes[-1]} modules: peak memory", peak, "MB", 1000.0)


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


def test_alone(tmp_path: Path, add: Add) -> None:
    """Long chains compiled and written, each in a process of its own, beside plant abc."""
    plants = {"abc": ABC}
    plants |= {f"chain-of-{n}": written(chain(n), tmp_path / str(n)) for n in (200, 1000)}
    for name, plant in plants.items():
        call = [sys.executable, "-c", ALONE, str(ABC), str(plant)]
        environment = {**os.environ, "PYTHONPATH": SOURCES}
        ran = subprocess.run(call, check=True, capture_output=True, text=True, env=environment)
        parts = (("CPU-time", "s"), ("peak-memory", "MB"), ("file", "MB"))
        for (what, unit), value in zip(parts, ran.stdout.split(), strict=True):
            add(f"{name}: {what}", float(value), unit, key=f"alone.{name}.{what}")
