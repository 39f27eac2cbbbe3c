"""The true model fitted to a recording: the best that can be had of held-out samples.

Source: Gauss 1809, with the rows of the priors added and a step halved where it does not help.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..sealed import Periods
from ..units import Array
from .balance import Course
from .case import Case
from .effects import SENSOR
from .knobs import Knob, base_knobs, effect_knobs
from .model import Model, noise_of
from .plant import Plant

STEPS = 3
HALVINGS = 3
DONE = 0.1
"""A step that gains less in log likelihood is the last."""


@dataclass(frozen=True)
class _Fit:
    """A plant with its residuals (n,), over the noise, and half the sum of squares with priors."""

    plant: Plant
    course: Course
    residuals: Array
    cost: float


def heldout_errors(case: Case, heldout: Periods) -> dict[str, float]:
    """Root mean square of measured less simulated, V, by signal, in the periods held out.

    Fitted to all other samples, from the true values on. Raises ValueError where no sample, or
    every one, is held out.
    """
    out = _inside(case.setup.time, heldout)
    if not out.any() or out.all():
        raise ValueError("some samples must be held out, and some must not")
    layout = case.setup.layout
    readings = case.recording.readings
    model = Model(readings["time [s]"], readings[layout.input_column])
    sensors = case.plant.sensors
    measured = np.concatenate([readings[layout.columns[s.tank]] / noise_of(s) for s in sensors])
    knobs = [
        *base_knobs(layout, case.setup.plant),
        *effect_knobs(case.setup.plant, case.plant),
    ]
    fit = _fitted(model, measured, np.tile(~out, len(sensors)), case.plant, knobs)
    parts = np.split(fit.residuals, len(sensors))
    return {
        f"{s.tank}{SENSOR}": noise_of(s) * float(np.sqrt(np.mean(part[out] ** 2)))
        for s, part in zip(sensors, parts, strict=True)
    }


def _inside(time: Array, periods: Periods) -> NDArray[np.bool_]:
    inside = np.zeros(time.size, dtype=bool)
    for begin, end in periods:
        inside |= (time >= begin) & (time <= end)
    return inside


def _fitted(
    model: Model, measured: Array, used: NDArray[np.bool_], plant: Plant, knobs: Sequence[Knob]
) -> _Fit:
    """A few damped Gauss-Newton steps."""

    def at(plant: Plant) -> _Fit | None:
        try:
            course = model.course(plant)
        except ArithmeticError:  # a step to where a law has no value
            return None
        residuals = measured - model.readings(plant, course)
        cost = 0.5 * float(np.sum(residuals[used] ** 2) + np.sum(_priors(plant, knobs) ** 2))
        return _Fit(plant, course, residuals, cost)

    fit = at(plant)
    if fit is None:
        raise ValueError("the true model has no course")
    for _ in range(STEPS):
        further = _step(model, fit, used, knobs)
        for halving in range(HALVINGS):
            tried = at(_moved(fit.plant, knobs, further * 0.5**halving))
            if tried is not None and tried.cost < fit.cost:
                break
        else:
            return fit
        assert tried is not None
        gained, fit = fit.cost - tried.cost, tried
        if gained < DONE:
            break
    return fit


def _step(model: Model, fit: _Fit, used: NDArray[np.bool_], knobs: Sequence[Knob]) -> Array:
    """Step of all knobs; columns are scaled alike before they are solved for."""
    slopes = model.slopes(fit.plant, fit.course, knobs)[used]
    matrix = np.vstack([slopes, np.diag([1.0 / knob.u for knob in knobs])])
    target = np.concatenate([fit.residuals[used], _priors(fit.plant, knobs)])
    sizes = np.linalg.norm(matrix, axis=0)
    sizes[sizes == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(matrix / sizes, target, rcond=1e-8)[0] / sizes)


def _priors(plant: Plant, knobs: Sequence[Knob]) -> Array:
    """How far each knob is below what was stated, in standard uncertainties."""
    return np.array([(knob.mean - knob.of(plant)) / knob.u for knob in knobs])


def _moved(plant: Plant, knobs: Sequence[Knob], further: Array) -> Plant:
    for knob, by in zip(knobs, further.tolist(), strict=True):
        plant = knob.set(plant, knob.of(plant) + by)
    return plant
