"""How effort grows: CPU time over modules, samples, findings, effects and plants."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.fleet.plant_day import Task, hash_of, judge_day

from rulec.effects.match_effects import match_effects
from rulec.passes.pipeline import compile_plant, run_passes
from rulec.passes.types import Compilation
from tests.bench.rigs import chain, side_by_side
from tests.bench.row import median
from tests.conftest import ROOT, compiled
from tests.rig.fleet import write_day
from tests.rig.follower.plants import Planted, recorded

ROWS, EPISODE, HOUR, LONG = 10_000, 13, 3600, 900


@dataclass(frozen=True, kw_only=True)
class Curve:
    """CPU time, s, by how many there are; `exponent` of the power that fits best."""

    key: str
    what: str
    counts: tuple[int, ...]
    seconds: tuple[float, ...]

    @property
    def exponent(self) -> float:
        slope, _ = np.polyfit(np.log(self.counts), np.log(self.seconds), 1)
        return float(slope)


def curves() -> Iterator[Curve]:
    """All curves, one after the other."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield _modules(folder, "side by side", side_by_side, (14, 35, 70, 140))
        yield _modules(folder, "in a chain", chain, (12, 24, 48, 96))
        yield _samples((12_500, 25_000, 50_000, 100_000))
        yield _findings((24, 48, 96, 192))
        yield _long_plants(folder, (24, 48, 96, 192))
        yield _effects(folder, (7, 14, 28, 56))
        yield _plants(folder, (2, 4, 8, 16))


def _modules(folder: Path, words: str, text: Callable[[int], str], sizes: Sequence[int]) -> Curve:
    counts, seconds = [], []
    compile_plant(ROOT / "plants" / "abc")
    for size in sizes:
        (folder / "plant.yaml").write_text(text(size), encoding="utf-8")
        counts.append(len(compile_plant(folder).modules))
        seconds.append(median(lambda: compile_plant(folder), 1, warm=False))
    what = f"compile: modules {words}"
    return Curve(
        key=words.replace(" ", "-"), what=what, counts=tuple(counts), seconds=tuple(seconds)
    )


def _samples(sizes: Sequence[int]) -> Curve:
    rules, seconds = compiled("abc"), []
    for size in sizes:
        part = recorded(rules, size, [], 1.0, np.random.default_rng(2))
        seconds.append(median(lambda part=part: diagnose(part, rules), 3))
    what = "diagnose: healthy samples"
    return Curve(key="samples", what=what, counts=tuple(sizes), seconds=tuple(seconds))


def _findings(sizes: Sequence[int]) -> Curve:
    rules, counts, seconds = compiled("abc"), [], []
    faults = [f.id for f in rules.faults if not f.in_sensor and f.lowest <= 0.3]
    for size in sizes:
        firsts = np.linspace(100, ROWS - 100, size).astype(int).tolist()
        planted = [
            Planted(faults[k % len(faults)], 0.3, first, first + EPISODE)
            for k, first in enumerate(firsts)
        ]
        recording = recorded(rules, ROWS, planted, 1.0, np.random.default_rng(1))
        counts.append(len(diagnose(recording, rules).findings))
        seconds.append(median(lambda r=recording: diagnose(r, rules), 1, warm=False))
    what = f"diagnose: findings in {ROWS:,} samples"
    return Curve(key="findings", what=what, counts=tuple(counts), seconds=tuple(seconds))


def _long_plants(folder: Path, sizes: Sequence[int]) -> Curve:
    """Of chains, with a fault in the middle of the recording."""
    seconds = []
    for size in sizes:
        (folder / "plant.yaml").write_text(chain(size), encoding="utf-8")
        rules = compile_plant(folder)
        fault = next(f.id for f in rules.faults if not f.in_sensor and f.lowest <= 0.3)
        planted = [Planted(fault, 0.3, LONG // 3, LONG // 2)]
        recording = recorded(rules, LONG, planted, 1.0, np.random.default_rng(1))
        seconds.append(median(partial(diagnose, recording, rules), 1, warm=False))
    what = f"diagnose: modules in a chain, a fault in {LONG} samples"
    return Curve(key="long", what=what, counts=tuple(sizes), seconds=tuple(seconds))


def _effects(folder: Path, sizes: Sequence[int]) -> Curve:
    counts, seconds = [], []
    for size in sizes:
        (folder / "plant.yaml").write_text(side_by_side(size), encoding="utf-8")
        models = run_passes(Compilation(path=folder))
        readings = {s.id: s.reference for s in models.ruleset.signals}
        begin = time.process_time()
        found = match_effects(models, readings)
        seconds.append(time.process_time() - begin)
        counts.append(len(found.candidates))
    what = "mismatch: effects that a plant may leave out, matched to its places"
    return Curve(key="effects", what=what, counts=tuple(counts), seconds=tuple(seconds))


def _plants(folder: Path, sizes: Sequence[int]) -> Curve:
    models = run_passes(Compilation(path=ROOT / "plants" / "abc"))
    text = models.ruleset.to_json()
    tasks = []
    for number in range(1, max(sizes) + 1):
        write_day(models, folder, number, HOUR)
        file = folder / f"plant=P{number:04d}" / "day=2026-01-01" / "day.parquet"
        tasks.append(
            Task(plant=f"P{number}", day="2026-01-01", files=(str(file),), marks=("",),
                 ruleset=hash_of(text), trace=False)
        )  # fmt: skip

    def judged(count: int) -> None:
        for task in tasks[:count]:
            assert judge_day(task, text)["judged"]

    seconds = [median(lambda n=n: judged(n), 3) for n in sizes]
    what = "fleet: plants, an hour of each at a row a second"
    return Curve(key="plants", what=what, counts=tuple(sizes), seconds=tuple(seconds))
