"""A calibrated ruleset for every replicate: recorded, calibrated and compiled as a maker does."""

from __future__ import annotations

import contextlib
import functools
import io
from pathlib import Path

from rulec.cli import main
from runtime.ruleset import Ruleset
from runtime.ruleset_file import read_ruleset
from tests.conftest import ROOT
from tests.rig.mixing_rig.cases import Task
from tests.truth import RIGS, Sensing, calibration_run, record, write_csv

BENCH_SEED = 500_000  # a bench has sensors of its own
Key = tuple[str, Sensing, int]


def key_of(task: Task) -> Key:
    """Plant, sensors of the bench and number of the draw."""
    return task.plant, task.sensing, task.draw


def commission(folder: Path, key: Key) -> None:
    """Write the ruleset of a replicate into a folder."""
    plant, sensing, draw = key
    place = folder / f"{plant}-{sensing.law}-{draw}"
    place.mkdir()
    text = (ROOT / "plants" / plant / "plant.yaml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if not line.startswith("calibration:")]
    plain = "\n".join([*kept, f"kb: {ROOT / 'kb'}"]) + "\n"
    (place / "plant.yaml").write_text(plain, encoding="utf-8")
    made = record(calibration_run(RIGS[plant]()), sensing, BENCH_SEED + draw)
    write_csv(place / "bench.csv", made.readings)
    _call("calibrate", place, place / "bench.csv", "-o", place / "found.yaml")
    (place / "plant.yaml").write_text(plain + "calibration: [found.yaml]\n", encoding="utf-8")
    _call("compile", place, "-o", ruleset_file(folder, key))


@functools.lru_cache(maxsize=128)
def ruleset_of(folder: Path, key: Key) -> Ruleset:
    """Read what `commission` wrote, once per process."""
    return read_ruleset(ruleset_file(folder, key))


def ruleset_file(folder: Path, key: Key) -> Path:
    """Where `commission` writes."""
    plant, sensing, draw = key
    return folder / f"{plant}-{sensing.law}-{draw}.ruleset.json"


def _call(*arguments: object) -> None:
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(shown):
        code = main([str(a) for a in arguments])
    assert code == 0, shown.getvalue()
