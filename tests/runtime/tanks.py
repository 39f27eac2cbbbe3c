"""Recordings of plants that store, made with their own balances and true parameters."""

from collections.abc import Mapping

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.stores.free_balances import start_of, with_free_states
from rulec_runtime.recordings.recording import Recording

from rulec.simulation.sensing import SensorErrors, sense
from tests.conftest import compiled as plant
from tests.runtime.sheets import sampled

Fault = tuple[str, float, float]
"""Id, degree, and the share of the recording behind which it is there."""


def made(
    name: str,
    seed: int,
    fault: Fault | None = None,
    count: int = 1024,
    spread: float = 0.5,
    until: float = 1.0,
) -> Recording:
    """A recording: true parameters within `spread` uncertainties, sensors within their class; a
    fault is over behind the share `until`."""
    ruleset, random = plant(name), np.random.default_rng(seed)
    dynamics = ruleset.dynamics
    time: Array = np.arange(count, dtype=np.float64) * 4.0
    inputs = given(name, random, time)
    values = _true(dynamics.values, dynamics.uncertainties, random, spread)
    moving = (f"x.{fault[0]}",) if fault else ()
    balances = with_free_states(dynamics, moving)
    table = [inputs[n] for n in dynamics.inputs]
    if fault:
        there = (time >= fault[2] * time[-1]) & (time <= until * time[-1])
        table.append(np.where(there, fault[1], 0.0))
    starts = dynamics.plan.select([f"start:{s.id}" for s in dynamics.states])
    begin = starts.run({n: np.asarray(v) for n, v in dynamics.values.items()})
    values |= {start_of(s.id): begin[f"start:{s.id}"].item() for s in dynamics.states}
    held = np.ones(len(table), dtype=bool)
    shown = balances.run(time, np.column_stack(table), held, values).shown
    true = {**inputs, **dict(zip(dynamics.outputs, shown.T, strict=True))}
    true = {n: v for n, v in true.items() if n != "upper.y"}
    readings = sense(ruleset, true, SensorErrors(bounded=True), random)
    for signal in (ruleset.signal_by_id[n] for n in readings):
        readings[signal.id] = np.clip(readings[signal.id], signal.lowest, signal.highest)
    missing = tuple(n for n in dynamics.outputs if n not in readings)
    return sampled(readings, time, missing)


def _true(
    values: Mapping[str, float], u: Mapping[str, float], random: np.random.Generator, spread: float
) -> dict[str, float]:
    errors = {n: float(np.clip(random.standard_normal(), -2.0, 2.0)) * spread for n in values}
    sizes = {n: np.log1p(u[n] / abs(v)) if v else u[n] for n, v in values.items()}
    return {
        n: float(v * np.exp(sizes[n] * errors[n]) if v else sizes[n] * errors[n])
        for n, v in values.items()
    }


def given(name: str, random: np.random.Generator, time: Array) -> dict[str, Array]:
    if name == "cascaded-tanks":
        return {"pump.u": _steps(random, time, 15, 1.5, 3.2)}
    litre = 1e-3 / 60.0
    supply, first = _steps(random, time, 20, 3.0, 9.0), _steps(random, time, 20, 3.0, 9.0)
    lateral = _steps(random, time, 25, 1.0, 5.0)
    # Switched so that the tanks neither run empty nor over.
    return {
        "supply.Q": litre * supply,
        "pump1.Q": litre * _balanced(supply, first),
        "lateral.Q": litre * lateral,
        "pump2.Q": litre * _balanced(_balanced(supply, first) + lateral, first + 2.0),
    }


def _steps(random: np.random.Generator, time: Array, length: int, low: float, high: float) -> Array:
    levels = random.uniform(low, high, len(time) // length + 1)
    return np.repeat(levels, length)[: len(time)]


def _balanced(inflow: Array, wish: Array) -> Array:
    """An outflow near a wish that brings a stored volume back again and again."""
    stored, result = 0.0, np.empty(len(inflow))
    for i, flow in enumerate(inflow):
        result[i] = max(wish[i] + 0.6 * stored, 0.0)
        stored += (flow - result[i]) * 4.0 / 60.0
    return result
