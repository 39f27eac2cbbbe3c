"""The limit of detection in hard cases of tanks: coloured noise, drifts and form errors, as random
terms of their true size; see `settled/blurred.py`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..spread import drift_directions, series_directions
from ..units import Array
from ..whiten import Whitening
from .balance import Course
from .build import METER_SLOPE, Setup
from .model import Model, noise_of
from .plant import LEVEL_ZERO, Plant

SMALL = 0.1
"""Share of a direction by which a law or an input is moved for its derivative."""


@dataclass(frozen=True)
class Blur:
    """Whitens changes of the readings, and has the changes by difficulties.

    Attributes
    ----------
    over : maps changes over their noise, shape (n, k), to the same with independent noise
    free : change by drifts and form errors per standard deviation, shape (n, m), not yet white
    """

    over: Callable[[Array], Array]
    free: Array


def blurred(setup: Setup, model: Model, course: Course) -> Blur:
    """Return the blur of a case with difficulties, linear at its plant without effects."""
    start = model.readings(setup.plant, course)
    bent = [model.readings(plant, model.course(plant)) for plant in _bent(setup.plant)]
    columns = [*_drifts(setup), *_meter(setup, start), *((b - start) / SMALL for b in bent)]
    free = np.column_stack(columns) if columns else np.zeros((start.size, 0))
    return Blur(_whitening(setup), free)


def _whitening(setup: Setup) -> Callable[[Array], Array]:
    """A sensor's noise is coloured, the steps of its converter are white."""
    sensors, n = setup.plant.sensors, setup.time.size
    parts = []
    for sensor in sensors:
        steps = np.sqrt(max(noise_of(sensor) ** 2 - sensor.noise**2, 0.0))
        sizes = np.tile(np.array([sensor.noise, steps]) / noise_of(sensor), (n, 1, 1))
        colours = np.array([sensor.colour, 0.0])
        parts.append(Whitening.of(sizes, colours, np.ones((n, 1), dtype=bool)))

    def over(changes: Array) -> Array:
        each = np.split(changes, len(sensors))
        return np.concatenate([p(e[:, None, :]) for p, e in zip(parts, each, strict=True)])

    return over


def _drifts(setup: Setup) -> Iterator[Array]:
    sensors, n = setup.plant.sensors, setup.time.size
    for j, sensor in enumerate(sensors):
        if sensor.wander is not None:
            for course in drift_directions(sensor.wander, n).T:
                change = np.zeros((len(sensors), n))
                change[j] = LEVEL_ZERO * course / noise_of(sensor)
                yield change.ravel()


def _meter(setup: Setup, start: Array) -> Iterator[Array]:
    """Changes by a meter whose gain drifts, so that the model gets another flow than the plant."""
    wander = setup.meter.wander
    if wander is None:
        return
    directions = drift_directions(wander, setup.time.size)
    directions[:, 0] -= 1.0  # the first error is part of the meter's gain, which is free anyway
    for course in directions.T:
        given = setup.shown * (1.0 - METER_SLOPE * SMALL * course)
        other = Model(setup.time, given)
        yield (other.readings(setup.plant, other.course(setup.plant)) - start) / SMALL


def _bent(plant: Plant) -> Iterator[Plant]:
    """The plant with each law moved a little along each direction of its form error."""
    if (form := plant.feed.form) is not None:
        for by in SMALL * series_directions(form.rms).T:
            yield replace(plant, feed=replace(plant.feed, form=form.further(by)))
    for tank in plant.tanks:
        if (form := tank.form) is not None:
            for by in SMALL * series_directions(form.rms).T:
                yield plant.with_tank(replace(tank, form=form.further(by)))
