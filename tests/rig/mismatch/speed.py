"""How long an analysis takes: 100,000 samples of seven modules, and how that grows.

The recording is one of a rig in which one pump's slip also grows with pressure: a recording from
which something is missing takes several times as long as a clean one.
"""

from __future__ import annotations

import csv
import resource
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.conftest import ROOT
from tests.rig.mismatch.ask import Answer, ask, call
from tests.rig.mismatch.case import Case, copy_plant

PLANT = "mixing-rig"
INPUTS = Path("examples") / "calibration.csv"
SAMPLES = (10_000, 30_000, 100_000)
SHARES = (25, 50, 100)
"""Percent of the catalogue of effects."""

SEED = 1

TYPE, CHANGED = "dosing-pcp", "dosing-pcp-slipping"
PLANTED = "slip-linear"
LAW = ("C0 + C1*n + C2*dp**2}", "C0 + C1*n + C2*dp**2 + C3*dp}")
PARAMETER = '  C3: {value: 8, unit: l/h/bar, u: 0.1, title: more slip, source: "[assumed]"}\n'


@dataclass(frozen=True)
class Timed:
    """An answer and what it cost, s."""

    case: Case
    answer: Answer
    cpu: float


def long_inputs(source: Path, target: Path, samples: int) -> None:
    """Repeat a recording until it has as many rows, one second apart."""
    with source.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    time = header.index("time [s]")
    with target.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(header)
        for number in range(samples):
            row = list(rows[number % len(rows)])
            row[time] = str(number)
            writer.writerow(row)


def prepare(work: Path, samples: int = SAMPLES[-1]) -> Case:
    """The rig, simulated with noise over a long recording: nothing is missing."""
    plant = copy_plant(PLANT, work)
    recording = _simulated(work, plant, samples, "clean")
    return Case(f"{samples} samples, seven modules, clean", plant, recording, recording)


def growth(work: Path) -> Iterator[Timed]:
    """Time for more and more samples, and for a larger and larger catalogue."""
    plant = copy_plant(PLANT, work)
    true = _true_plant(work)
    for samples in SAMPLES:
        recording = _simulated(work, true, samples, "planted")
        yield timed(Case(f"{samples} samples, whole catalogue", plant, recording, recording), work)
    for share in SHARES[:-1]:
        small = _with_catalogue(work, share)
        yield timed(Case(f"{samples} samples, {share} % of it", small, recording, recording), work)


def timed(case: Case, work: Path) -> Timed:
    """Ask, and count what the processor did: other work on the machine does not matter."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = ask(case, work)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Timed(case, answer, cpu)


def growth_lines(found: Iterator[Timed]) -> Iterator[str]:
    """One line per case, as it is known."""
    for t in found:
        named = ", ".join(f"{name} of {module}" for name, module, _, _ in t.answer.named)
        yield (
            f"{t.case.name:36} {t.cpu:6.1f} s of CPU, {t.answer.seconds:6.1f} s; "
            f"{t.answer.form['tried']} candidates tried; named: {named or 'nothing'}"
        )


def _simulated(work: Path, plant: Path, samples: int, name: str) -> Path:
    inputs, recording = work / "long-inputs.csv", work / f"{name}-{samples}.csv"
    long_inputs(ROOT / "plants" / PLANT / INPUTS, inputs, samples)
    call("simulate", plant, inputs, "-o", recording, "--noise", SEED)
    return recording


def _true_plant(work: Path) -> Path:
    """The rig with a pump whose law has one term more."""
    folder = work / "true"
    knowledge, plant = folder / "kb", folder / PLANT
    shutil.copytree(ROOT / "kb", knowledge)
    shutil.copytree(ROOT / "plants" / PLANT, plant)
    text = (knowledge / "modules" / f"{TYPE}.yaml").read_text(encoding="utf-8")
    text = text.replace(f"module: {TYPE}", f"module: {CHANGED}").replace(*LAW)
    text = text.replace("definitions:", f"{PARAMETER}definitions:")
    (knowledge / "modules" / f"{CHANGED}.yaml").write_text(text, encoding="utf-8")
    for file in ("plant.yaml", "calibration.yaml"):
        text = (plant / file).read_text(encoding="utf-8").replace(TYPE, CHANGED, 1)
        text += f"kb: {knowledge}\n" if file == "plant.yaml" else ""
        (plant / file).write_text(text, encoding="utf-8")
    return plant / "plant.yaml"


def _with_catalogue(work: Path, share: int) -> Path:
    """The plant with a part of the effects: every so-manyth, and the one that is there."""
    folder = work / f"catalogue-{share}"
    knowledge = folder / "kb"
    shutil.copytree(ROOT / "kb", knowledge)
    effects = sorted((knowledge / "effects").glob("*.yaml"))
    for number, file in enumerate(effects):
        if number * share % 100 >= share and file.stem != PLANTED:
            file.unlink()
    plant = folder / PLANT
    shutil.copytree(ROOT / "plants" / PLANT, plant)
    text = (plant / "plant.yaml").read_text(encoding="utf-8")
    (plant / "plant.yaml").write_text(f"{text}kb: {knowledge}\n", encoding="utf-8")
    return plant / "plant.yaml"
