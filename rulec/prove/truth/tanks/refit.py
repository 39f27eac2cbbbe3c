"""The true model fitted to a recording: the least error on held-out samples.

Source: Gauss 1809, with rows for the priors; a step that does not help is halved.
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
from .effect import SENSOR
from .model import Knob, Model, base_knobs, effect_knobs, noise_of
from .plant import Plant

STEPS = 3
HALVINGS = 3
DONE = 0.1
"""The fit ends with a step that gains less in log likelihood."""


@dataclass(frozen=True)
class _Fit:
    """A plant with its residuals (n,), over the noise, and half their sum of squares and priors."""

    plant: Plant
    course: Course
    residuals: Array
    cost: float


def heldout_errors(case: Case, heldout: Periods) -> dict[str, float]:
    """Return the RMS of measured minus simulated, V, by signal, in the held-out periods.

    The fit to all other samples starts at the true values. Raises ValueError if no sample, or every
    one, is held out.
    """
    time, out = case.setup.time, np.zeros(case.setup.time.size, dtype=bool)
    for begin, end in heldout:
        out |= (time >= begin) & (time <= end)
    if not out.any() or out.all():
        raise ValueError("some samples must be held out, and some must not")
    layout = case.setup.layout
    readings = case.recording.readings
    model = Model(readings["time [s]"], readings[layout.input_column])
    sensors = case.plant.sensors
    measured = np.concatenate([readings[layout.columns[s.tank]] / noise_of(s) for s in sensors])
    plain = case.setup.plant
    knobs = [*base_knobs(layout, plain), *effect_knobs(plain, case.plant)]
    fit = _fitted(model, measured, np.tile(~out, len(sensors)), case.plant, knobs)
    parts = np.split(fit.residuals, len(sensors))
    return {
        f"{s.tank}{SENSOR}": noise_of(s) * float(np.sqrt(np.mean(part[out] ** 2)))
        for s, part in zip(sensors, parts, strict=True)
    }


def _fitted(
    model: Model, measured: Array, used: NDArray[np.bool_], plant: Plant, knobs: Sequence[Knob]
) -> _Fit:
    """A few damped Gauss-Newton steps."""

    def at(plant: Plant) -> _Fit | None:
        try:
            course = model.course(plant)
        except ArithmeticError:  # a law has no value there
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
    """Step of all knobs; columns are normalised before they are solved for."""
    slopes = model.slopes(fit.plant, fit.course, knobs)[used]
    matrix = np.vstack([slopes, np.diag([1.0 / knob.u for knob in knobs])])
    target = np.concatenate([fit.residuals[used], _priors(fit.plant, knobs)])
    sizes = np.linalg.norm(matrix, axis=0)
    sizes[sizes == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(matrix / sizes, target, rcond=1e-8)[0] / sizes)


def _priors(plant: Plant, knobs: Sequence[Knob]) -> Array:
    """Prior mean minus value of each knob, in standard uncertainties."""
    return np.array([(knob.mean - knob.of(plant)) / knob.u for knob in knobs])


def _moved(plant: Plant, knobs: Sequence[Knob], further: Array) -> Plant:
    for knob, by in zip(knobs, further.tolist(), strict=True):
        plant = knob.set(plant, knob.of(plant) + by)
    return plant
