"""Recordings made from a plant's own equations, with something built in that the plant lacks.

The readings are those at which all estimates of an amended plant balance. They come from the same
plans as the analysis, so these recordings test the analysis, not the equations.
"""

import csv
import functools
import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.recordings.recording import Recording

from rulec.algebra.tangent import run_with_slopes
from rulec.effects.candidate import TIME, BaseParameters
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.analyse import analyse
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.prepare import Data, prepare
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.evidence.steady.system import system_of
from rulec.mismatch.inference.heldout_errors import series_csv
from rulec.mismatch.result import Mismatch
from rulec.simulation.sensing import SensorErrors, sense
from tests.conftest import ROOT
from tests.runtime.sheets import sampled

DWELL = 12
"""Samples at an operating point."""

WARMEST, USUAL = 30.0, 293.15
"""Kelvin above the usual temperature, and that."""

SLIP = "A.slip-temperature@Q_geo"

Built = Mapping[str, Mapping[str, Array | float]]
"""Per candidate its parameters (by local names, SI), each a number or an array, shape (n,)."""


@dataclass(frozen=True)
class Sure:
    """A builder whose parameters are known as a calibration knows them."""

    builder: ModelBuilder
    parameters: BaseParameters

    def __getattr__(self, name: str) -> Any:
        return getattr(self.builder, name)


@functools.cache
def loaded(plant: str) -> tuple[Ruleset, ModelBuilder]:
    return open_builder(ROOT / "plants" / plant)


@functools.cache
def alone() -> tuple[Ruleset, ModelBuilder]:
    """One dosing module, nothing downstream: three estimates of one flow."""
    return open_builder(Path(__file__).parent / "plant.yaml")


def tour(
    ruleset: Ruleset, samples: int, low: float = 0.6, high: float = 1.25, dwell: int = DWELL
) -> dict[str, Array]:
    """Inputs (speeds) at settled points spread over a range around the reference point, SI."""
    number = np.arange(samples) // dwell
    given = {}
    for k, signal in enumerate(s for s in ruleset.signals if s.is_input):
        share = np.mod(0.5 + number * np.sqrt((2, 3, 5, 7, 11, 13)[k % 6]), 1.0)
        given[signal.id] = signal.reference * (low + (high - low) * share)
    return given


def warming(samples: int) -> Array:
    """A temperature that rises and falls once, K."""
    return USUAL + WARMEST * np.sin(np.pi * np.arange(samples) / samples) ** 2


def solved(
    ruleset: Ruleset,
    builder: ModelBuilder,
    given: Mapping[str, Array],
    built: Built | None = None,
    base: Mapping[str, float] | None = None,
) -> dict[str, Array]:
    """Readings, SI, at which all estimates balance; `base` are parameters other than stated."""
    built = built or {}
    n = len(next(iter(given.values())))
    names = [s for s in ruleset.simulation.steps for s in s.readings]
    size = np.array([abs(ruleset.signal_by_id[s].reference) for s in names])
    inputs: dict[str, Array | float] = {TIME: np.arange(n, dtype=float)}
    inputs |= builder.parameters.constants
    inputs |= dict(zip(builder.parameters.ids, builder.parameters.values.tolist(), strict=True))
    inputs |= {**given, **(base or {})}
    inputs |= {f"{c}.{name}": v for c, values in built.items() for name, v in values.items()}
    basis = residual_basis(ruleset, np.ones(len(ruleset.observers), dtype=bool))
    at = np.tile(size, (n, 1))
    for _ in range(30):
        inputs |= dict(zip(names, at.T, strict=True))
        left, slopes = _estimates(ruleset, builder, inputs, tuple(built), names, n)
        jacobian = np.einsum("ro,nos->nrs", basis, slopes) * size
        step = np.linalg.solve(jacobian, (left @ basis.T)[:, :, None])[:, :, 0] * size
        at = at - np.clip(step, -0.3 * size, 0.3 * size)
        if np.abs(step / size).max() < 1e-13:
            break
    return {**given, **dict(zip(names, at.T, strict=True))}


def _estimates(
    ruleset: Ruleset,
    builder: ModelBuilder,
    inputs: Mapping[str, Array | float],
    built: tuple[str, ...],
    names: list[str],
    n: int,
) -> tuple[Array, Array]:
    """Flows, shape (n, observers), and slopes by readings, shape (n, observers, readings)."""
    flows = np.zeros((n, len(ruleset.observers)))
    slopes = np.zeros((n, len(ruleset.observers), len(names)))
    for i, observer in enumerate(ruleset.observers):
        key = f"q:{observer.id}"
        plan = builder.plan(observer.module, built).select([key])
        values, by = run_with_slopes(plan, inputs, names)
        flows[:, i] = values[key]
        for name, slope in by[key].items():
            slopes[:, i, names.index(name)] = slope
    return flows, slopes


def recorded(
    loaded: tuple[Ruleset, ModelBuilder],
    given: Mapping[str, Array],
    built: Built | None = None,
    *,
    seed: int | None = 1,
    moved: bool = True,
) -> Recording:
    """A recording, one sample per second; without noise if there is no seed.

    The true parameters are drawn from what is stated of them, unless they are not `moved`.
    """
    ruleset, builder = loaded
    base: dict[str, float] = {}
    if seed is not None and moved:
        parameters = builder.parameters
        draw = np.random.default_rng(seed + 1000).multivariate_normal(
            parameters.values, parameters.covariance, method="eigh"
        )
        base = dict(zip(parameters.ids, draw.tolist(), strict=True))
    values = solved(ruleset, builder, given, built, base)
    if seed is not None:
        errors = SensorErrors(bounded=True)
        values = sense(ruleset, values, errors, np.random.default_rng(seed))
    return sampled(values)


def warmed(built: Built | None = None, samples: int = 240, seed: int | None = 1) -> Recording:
    given = {**tour(alone()[0], samples), "A.T": warming(samples)}
    return recorded(alone(), given, built, seed=seed)


def prepared(ruleset: Ruleset, recording: Recording, *heldout: tuple[float, float]) -> Data:
    return prepare(recording, ruleset, heldout)


def rows_at(loaded: tuple[Ruleset, ModelBuilder], recording: Recording) -> Rows:
    ruleset, builder = loaded
    return rows_of(system_of(ruleset, builder, prepared(ruleset, recording)), Configuration())


def fitted(
    loaded: tuple[Ruleset, ModelBuilder], recording: Recording, setting: Configuration | None = None
) -> Fitted:
    rows = rows_at(loaded, recording)
    return fit(rows, setting or Configuration(), rows.system.data.open)


def joined(fitted: Fitted, initial: InitialCandidate) -> Fitted:
    return fit(fitted.rows, initial.joined_to(fitted.setting), fitted.used)


def changed(recording: Recording, values: Mapping[str, Array]) -> Recording:
    return replace(recording, values={**recording.values, **values})


def compared(loaded: tuple[Ruleset, ModelBuilder], recording: Recording) -> Mismatch:
    return analyse(recording, *loaded)


def without(recording: Recording, *signals: str) -> Recording:
    kept = {name: v for name, v in recording.values.items() if name not in signals}
    return replace(recording, values=kept)


def columns(found: Mismatch) -> dict[str, np.ndarray]:
    head, *rows = csv.reader(io.StringIO(series_csv(found.series)))
    values = np.array([[float(cell) if cell else np.nan for cell in row] for row in rows])
    return dict(zip(head, values.T, strict=True))
