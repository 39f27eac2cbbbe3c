"""Tasks to answers: record, diagnose, and say in plain data what was answered."""

import functools
import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.verdict_per_sample import Trace, trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form

from rulec.prove.truth.streams import factor
from tests import dosing as truth
from tests.conftest import ROOT
from tests.dosing import RIGS, Plant, Sensing, calibration_run, record, write_csv
from tests.method.readings import recording
from tests.rig.called import called, commissioned
from tests.rig.mixing_rig.cases import Task


@dataclass(frozen=True)
class Answer:
    """What is said at the end of a plateau: faults with degree and probability, the most probable
    first."""

    group: str
    mode: str
    case: int
    set_degree: float
    true: Mapping[str, float]
    named: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class Samples:
    """Every sample on its own: verdict, the true degree of one fault, and the one told."""

    group: str
    mode: str
    verdict: tuple[str, ...]
    true: Array
    degree: Array


@dataclass(frozen=True)
class Covered:
    """Samples of a recording by what the findings say about them."""

    mode: str
    samples: int
    fault: int
    unknown: int


@dataclass(frozen=True)
class Judged:
    """All that some tasks gave."""

    answers: tuple[Answer, ...]
    samples: tuple[Samples, ...]
    covered: tuple[Covered, ...]


def run(folder: Path, tasks: Sequence[Task], workers: int) -> Judged:
    """All answers in the order of the tasks; with fewer than 2 workers in this process.

    `folder` keeps the rulesets, each replicate commissioned once, for the tasks of a later call.
    """
    wanted = dict.fromkeys(key_of(task) for task in tasks)
    keys = [key for key in wanted if not ruleset_file(folder, key).exists()]
    prepare, answer = functools.partial(commission, folder), functools.partial(judge, folder)
    if workers < 2:
        for key in keys:
            prepare(key)
        parts = [answer(task) for task in tasks]
    else:
        with ProcessPoolExecutor(workers) as pool:
            list(pool.map(prepare, keys))
            parts = list(pool.map(answer, tasks, chunksize=4))
    return Judged(
        tuple(a for part in parts for a in part.answers),
        tuple(s for part in parts for s in part.samples),
        tuple(c for part in parts for c in part.covered),
    )


def judge(folder: Path, task: Task) -> Judged:
    rules = ruleset_of(folder, key_of(task))
    made = truth.record(task.case.run, task.sensing, task.case.seed)
    readings = recording(rules, made.readings)
    answers: list[Answer] = []
    samples: list[Samples] = []
    covered = []
    for mode in task.modes:
        form = diagnosis_form(diagnose(readings, rules, mode))
        answers += [_answer(task, mode, form, made.truth, span) for span in task.plateaus]
        covered.append(_covered(mode, form, readings))
        if task.samples:
            samples.append(_samples(task, mode, rules, trace(readings, rules, mode), made.truth))
    return Judged(tuple(answers), tuple(samples), tuple(covered))


def _answer(
    task: Task,
    mode: str,
    form: Mapping[str, Any],
    columns: Mapping[str, Array],
    span: tuple[int, int],
) -> Answer:
    """What is said at the last but one sample of a plateau.

    The true degree is the mean over the part of the plateau that the finding rests on: a valve
    is still moving a little when a stretch counts as settled.
    """
    time = columns["time [s]"]
    now = float(time[span[1] - 2])
    said = sorted(_in_force(form["findings"], now), key=lambda f: -f["probability"])
    since = max([float(time[span[0]]), *(float(f["since"]) for f in said)])
    part = (time >= since) & (time <= time[span[1] - 1])
    true = {name: float(columns[f"{name} [1]"][part].mean()) for name in task.case.faults}
    named = ((f["fault"], float(f["degree"]), float(f["probability"])) for f in said)
    set_degree = next(iter(task.case.faults.values()))
    return Answer(task.group, mode, task.case.seed, set_degree, true, tuple(named))


def _in_force(entries: Any, now: float) -> list[Mapping[str, Any]]:
    return [e for e in entries if e["since"] <= now <= e["until"]]


def _covered(mode: str, form: Mapping[str, Any], readings: Recording) -> Covered:
    """Count the samples inside findings, and inside periods that nothing known explains."""

    def inside(entries: Any) -> NDArray[np.bool_]:
        flags = np.zeros(len(readings), dtype=bool)
        for entry in entries:
            flags |= (readings.time >= entry["since"]) & (readings.time <= entry["until"])
        return flags

    fault, unknown = inside(form["findings"]), inside(form.get("unknown", ()))
    return Covered(mode, len(readings), int(fault.sum()), int((unknown & ~fault).sum()))


def _samples(
    task: Task, mode: str, rules: Ruleset, result: Trace, columns: Mapping[str, Array]
) -> Samples:
    fault = next(iter(task.case.faults))
    k = [f.id for f in rules.faults].index(fault)
    true = columns[f"{fault} [1]"]
    return Samples(task.group, mode, result.verdict, true, result.degree[k])


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


def drawn(plant: Plant, seed: int) -> Plant:
    """Return a plant of the same type, each parameter drawn within the uncertainty of its sheet."""
    rig = plant.rig
    random = np.random.default_rng([seed, len(rig.pumps), len(rig.mixers)])
    shares = {name: u / value for name, (value, u) in rig.numbers.items() if value}
    factors = {name: factor(share, random) for name, share in shares.items()}
    return plant.with_values({n: v * factors.get(n, 1.0) for n, v in plant.values.items()})
