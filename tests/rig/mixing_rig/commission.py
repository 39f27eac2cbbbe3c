"""A calibrated ruleset for every replicate: recorded, calibrated and compiled as a maker does."""

import functools
import shutil
from pathlib import Path

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset

from tests.conftest import ROOT
from tests.dosing import RIGS, Plant, Sensing, calibration_run, record, write_csv
from tests.rig.called import called, commissioned
from tests.rig.mixing_rig.cases import Task
from tests.rig.mixing_rig.drawn import drawn

BENCH_SEED = 500_000  # a bench has sensors of its own
Key = tuple[str, Sensing, int, bool]


def key_of(task: Task) -> Key:
    """Plant, sensors of the bench, number of the draw, whether the plant is off its data sheet."""
    return task.plant, task.sensing, task.draw, task.spread


def plant_of(key: Key) -> Plant:
    plant, _, draw, spread = key
    return drawn(RIGS[plant], draw) if spread else RIGS[plant]


def commission(folder: Path, key: Key) -> None:
    """Write the ruleset of a replicate into a folder."""
    plant, sensing, draw, _ = key
    place = folder / _name(key)
    place.mkdir()
    shutil.copy(ROOT / "plants" / plant / "plant.yaml", place)
    made = record(calibration_run(plant_of(key)), sensing, BENCH_SEED + draw)
    write_csv(place / "bench.csv", made.readings)
    # About one bench in a hundred is refused; what its values do to a diagnosis counts here too.
    commissioned(place / "plant.yaml", place / "bench.csv", "--force")
    called("compile", place, "-o", ruleset_file(folder, key))


@functools.lru_cache(maxsize=128)
def ruleset_of(folder: Path, key: Key) -> Ruleset:
    """Read what `commission` wrote, once per process."""
    return read_ruleset(ruleset_file(folder, key))


def ruleset_file(folder: Path, key: Key) -> Path:
    return folder / f"{_name(key)}.ruleset.json"


def _name(key: Key) -> str:
    plant, sensing, draw, spread = key
    return f"{plant}-{sensing.law}-{draw}" + "-spread" * spread
