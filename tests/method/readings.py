"""Readings of the independent truth, as inputs of a ruleset; plants of this folder, compiled."""

import functools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import systematic_u

from rulec.passes.pipeline import compile_plant
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR
from tests import dosing as truth
from tests.conftest import ROOT

HERE = Path(__file__).parent
PLANTS = HERE / "plants"
PUMPS = ("abc", "abc-membrane", "abc-centrifugal")
"""The plant abc with three kinds of pump in module A."""


def data(name: str) -> Any:
    """A table of cases beside the tests."""
    return yaml.safe_load((HERE / name).read_text(encoding="utf-8"))


def calibrated(rules: Ruleset) -> Ruleset:
    """The same as if its laws were fitted to a recording, of any range."""
    signals = (replace(s, valid_from=-1e12, valid_to=1e12) for s in rules.signals)
    return replace(rules, signals=tuple(signals))


@functools.cache
def ruleset(plant: str) -> Ruleset:
    """A plant of this folder, or else a shipped one, compiled once per test run."""
    here = PLANTS / plant
    return compile_plant(here if here.is_dir() else ROOT / "plants" / plant)


def large_centrifugal() -> truth.Plant:
    """A large centrifugal pump (3.8 m3/h) beside a small pump: `plants/large-centrifugal`."""
    small, square = truth.RIGS["abc-centrifugal"], BAR / LITRE_PER_HOUR**2
    larger = {"h1": 0.15, "h2": 0.15**2, "p0": 1 / 0.15, "p2": 0.15}
    values = {f"A.{name}": factor * small.values[f"A.{name}"] for name, factor in larger.items()}
    values |= {"A.k0": 0.02 * BAR, "A.k2": 4e-8 * square, "C.k2": 2e-8 * square}
    return small.with_values(values)


BUILT = {**truth.RIGS, "large-centrifugal": large_centrifugal()}
"""The truth behind each plant."""


def built(plant: str) -> truth.Plant:
    """The true plant of a name."""
    return BUILT[plant]


def noise_free(plant: str, fault: str = "", degree: Any = 0.0) -> dict[str, Array]:
    """Readings (SI) at nominal speed with a fault of one or several degrees."""
    degrees = np.atleast_1d(np.asarray(degree, dtype=np.float64))
    operation = truth.healthy_run(built(plant), degrees.size).operation
    run = truth.Run(built(plant), operation, {fault: degrees} if fault else {})
    return to_si(ruleset(plant), truth.record(run, truth.NOISE_FREE).readings)


def to_si(rules: Ruleset, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns with units in their headers to SI values by signal."""
    found = {s.id: (s, columns.get(f"{s.id} [{s.unit}]")) for s in rules.signals}
    return {n: v * s.factor + s.offset for n, (s, v) in found.items() if v is not None}


def evaluate(rules: Ruleset, values: Mapping[str, Array]) -> dict[str, Array]:
    """All outputs of the plan."""
    signals = [s for s in rules.signals if s.id in values]
    u = {f"u:{s.id}": systematic_u(s, values[s.id]) for s in signals}
    return rules.plan.run({**values, **u, "u:parameters": 1.0, "u:model": 1.0})


def points(rules: Ruleset, values: Mapping[str, Array]) -> Points:
    """Operating points whose readings are as uncertain as their sensors."""
    spread = {
        s.id: np.broadcast_to(systematic_u(s, values[s.id]), values[s.id].shape)
        for s in rules.signals
        if s.id in values
    }
    bad = {name: ~np.isfinite(v) for name, v in values.items()}
    return Points(values=values, u=spread, systematic=spread, bad=bad, why={})


def chances(plant: str, values: Mapping[str, Array]) -> dict[str, float]:
    """Probability of each fault at the first operating point, in the default mode."""
    rules = ruleset(plant)
    found = isolate(rules, observe(rules, points(rules, values))).probability[:, 0]
    return {f.id: float(p) for f, p in zip(rules.faults, found, strict=True)}


def noisy(
    rules: Ruleset, values: Mapping[str, Array], seeds: int, random: np.random.Generator
) -> dict[str, Array]:
    """Each point `seeds` times, each with new sensor errors of half their bound."""
    result = {}
    for signal in (s for s in rules.signals if s.id in values):
        true = np.repeat(values[signal.id], seeds)
        error = systematic_u(signal, true) * random.normal(size=true.size)
        result[signal.id] = true + error
    return result


def recording(rules: Ruleset, columns: Mapping[str, Array]) -> Recording:
    """A recording as the reader would give it."""
    time, values = columns["time [s]"], to_si(rules, columns)
    segment = np.zeros(time.size, dtype=int)
    return Recording(time=time, values=values, segment=segment, missing=(), notes=())


def signs(values: Mapping[str, Array], residuals: list[str], flow: float) -> list[str]:
    """`+`, `-` or `0` per residual; 0 below 1e-6 of a flow."""
    sizes: NDArray[np.float64] = np.array([values[f"R:{r}"][0] for r in residuals]) / flow
    return ["0" if abs(s) < 1e-6 else "+" if s > 0 else "-" for s in sizes]


def row_of(matrix: Mapping[str, Any], fault: str) -> list[str]:
    """A row of the derived matrix as signs."""
    row = matrix["signs"][matrix["faults"].index(fault)]
    return [{1: "+", -1: "-", 0: "0"}[s] for s in row]
