"""A true plant as a model: its parameters, expected readings over their noise, derivatives; and its
fit to a recording, for the least error on held-out samples.

Source: Gauss 1809, with rows for the priors; a step that does not help is halved.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sealed import Periods
from ..units import Array
from .balance import Course, integrate
from .build import CARD_ZERO, LITRE_PER_HOUR, METER_SLOPE, Layout, Setup
from .effect import SENSOR
from .plant import LEVEL_ZERO, LevelSensor, Plant
from .sensing import shown

Path = tuple[str | int, ...]

TANK = {"area": (15.0, 1.0, 0.1), "outlet": (0.05, 0.04, 1e-4), "level": (10.0, 8.0, 1e-6)}
"""Mean, standard uncertainty and least value in `open-tank`: cm2, cm2, cm."""

GAIN = (0.5, 0.2, 0.01)
ZERO = (0.0, math.hypot(0.5, LEVEL_ZERO), -math.inf)
"""Of a level transmitter; the zero combines that of the module type and that of its class."""

VOLTAGE_GAIN = (2.5, 2.0, 0.01)
"""In `voltage-pump`, cm3/s/V."""

NOT_VARIED = ("begin", "stuck", "step")
"""Parameters of effects by which readings jump, or have no derivative."""

STEP = 0.01
"""Finite difference as share of the prior uncertainty, or of the value if the prior is flat."""


@dataclass(frozen=True)
class Knob:
    """A parameter of the plant.

    `path` leads to it; `u` is infinite for a flat prior; `least` is its lower bound.
    """

    path: Path
    mean: float
    u: float
    least: float

    def of(self, plant: Plant) -> float:
        """Return its value."""
        found: Any = plant
        for part in self.path:
            found = found[part] if isinstance(part, int) else getattr(found, part)
        return float(found)

    def set(self, plant: Plant, value: float) -> Plant:
        """Return the plant with another value."""
        changed: Plant = _set(plant, self.path, max(value, self.least))
        return changed

    def step(self, plant: Plant) -> float:
        """Return the step of a finite difference."""
        return STEP * (self.u if math.isfinite(self.u) else max(abs(self.of(plant)), 1e-6))


def base_knobs(layout: Layout, plant: Plant) -> Iterator[Knob]:
    """Yield all that the plain model may fit: parameters, first levels, errors of sensors."""
    if layout.metered:
        yield Knob(("feed", "gain"), LITRE_PER_HOUR, METER_SLOPE * LITRE_PER_HOUR, 0.0)
    else:
        yield Knob(("feed", "gain"), *VOLTAGE_GAIN)
        yield Knob(("feed", "zero"), 0.0, CARD_ZERO, -math.inf)
    for i in range(len(plant.tanks)):
        for name, prior in TANK.items():
            yield Knob(("tanks", i, name), *prior)
    for j in range(len(plant.sensors)):
        yield Knob(("sensors", j, "gain"), *GAIN)
        yield Knob(("sensors", j, "zero"), *ZERO)


def effect_knobs(plain: Plant, plant: Plant) -> Iterator[Knob]:
    """Yield every number in which a plant differs from the plain one, with a flat prior."""
    for path, value in _numbers(plant, ()):
        if not set(path) & set(NOT_VARIED) and _at(plain, path) != value:
            yield Knob(path, value, math.inf, -math.inf if value < 0.0 else 0.0)


def _numbers(part: Any, path: Path) -> Iterator[tuple[Path, float]]:
    """Finite numbers of a plant, with the path to each."""
    match part:
        case float() if math.isfinite(part):
            yield path, part
        case tuple():
            for i, inner in enumerate(part):
                yield from _numbers(inner, (*path, i))
        case _ if dataclasses.is_dataclass(part):
            for field in dataclasses.fields(part):
                yield from _numbers(getattr(part, field.name), (*path, field.name))


def _at(part: Any, path: Path) -> Any:
    """The value at a path, or None."""
    for key in path:
        if part is None:
            return None
        part = part[key] if isinstance(key, int) else getattr(part, key)
    return part


def _set(part: Any, path: Path, value: float) -> Any:
    """A copy with one number changed."""
    if not path:
        return value
    key, *rest = path
    if isinstance(key, int):
        return (*part[:key], _set(part[key], tuple(rest), value), *part[key + 1 :])
    return dataclasses.replace(part, **{key: _set(getattr(part, key), tuple(rest), value)})


ONLY_READ = ("gain", "zero")
"""Parameters of a sensor that do not change the course of a plant."""


@dataclass(frozen=True)
class Model:
    """Operation of a plant: time, s, and recorded input, both of shape (samples,)."""

    time: Array
    given: Array

    def course(self, plant: Plant) -> Course:
        """Simulate a plant."""
        return integrate(plant, self.time, self.given, quick=True)

    def alike(self, plant: Plant, course: Course, other: Plant) -> Course:
        """Simulate another plant; the course is the same if only its readings differ."""
        same = (plant.feed, plant.tanks) == (other.feed, other.tanks)
        follow = any(s.lag or s.dead_time for s in (*plant.sensors, *other.sensors))
        return course if same and not follow else self.course(other)

    def readings(self, plant: Plant, course: Course) -> Array:
        """Return noise-free readings over their noise, sensor by sensor, shape (n,), 1."""
        values = shown(plant, course)
        return np.concatenate([values[s.tank] / noise_of(s) for s in plant.sensors])

    def slopes(self, plant: Plant, course: Course, knobs: Sequence[Knob]) -> Array:
        """Return the derivatives of the readings by each knob, shape (n, knobs).

        They are forward differences.
        """
        plain = self.readings(plant, course)
        columns = []
        for knob in knobs:
            step = knob.step(plant)
            turned = knob.set(plant, knob.of(plant) + step)
            only_read = knob.path[0] == "sensors" and knob.path[-1] in ONLY_READ
            happens = course if only_read else self.course(turned)
            columns.append((self.readings(turned, happens) - plain) / step)
        return np.column_stack(columns)


def noise_of(sensor: LevelSensor) -> float:
    """Return the standard deviation of a reading, V: white noise and steps of the converter.

    A step is uniform, GUM 4.3.7; coarse steps are an effect instead.
    """
    return math.hypot(sensor.noise, sensor.converter / math.sqrt(12.0))


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


def heldout_errors(
    setup: Setup, plant: Plant, readings: Mapping[str, Array], heldout: Periods
) -> dict[str, float]:
    """Return the RMS of measured minus simulated, V, by signal, in the held-out periods.

    The fit to all other samples starts at the true values. Raises ValueError if no sample, or every
    one, is held out.
    """
    time, out = setup.time, np.zeros(setup.time.size, dtype=bool)
    for begin, end in heldout:
        out |= (time >= begin) & (time <= end)
    if not out.any() or out.all():
        raise ValueError("some samples must be held out, and some must not")
    layout = setup.layout
    model = Model(readings["time [s]"], readings[layout.input_column])
    sensors = plant.sensors
    measured = np.concatenate([readings[layout.columns[s.tank]] / noise_of(s) for s in sensors])
    knobs = [*base_knobs(layout, setup.plant), *effect_knobs(setup.plant, plant)]
    fit = _fitted(model, measured, np.tile(~out, len(sensors)), plant, knobs)
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
