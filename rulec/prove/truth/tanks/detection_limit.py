"""The limit of detection of each planted effect, and its margin over other effects.

In hard cases coloured noise, drifts and form errors are random terms of their true size, as in
`settled/detection_limit.py`.
"""

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..detection_limit import Rival, expected_gain, margin
from ..smooth import drift_directions, series_directions
from ..units import Array
from ..whiten import Whitening
from .balance import Course
from .build import METER_SLOPE, Layout, Setup
from .effect import SENSOR, Built, Placed, possible_effects
from .effect_size import Planted, make
from .model import Model, base_knobs, noise_of
from .plant import LEVEL_ZERO, Plant
from .right_answer import right

SAME = ("offset-low", "gain-high", "gain-low", "drift-down", "power-low")
"""No rivals: mirror images of other effects, or the gain that is fitted anyway."""


def detection_limits(
    setup: Setup, planted: Sequence[Planted], seed: int
) -> list[tuple[float, float, str]]:
    """Return gain, margin and rival of each planted effect while the others may have any size; see
    `sealed.Planted`.

    All is linear at the plant without effects: changes, derivatives and rivals must be taken at one
    point, or the difference between two points could pass for any effect. A large effect that
    parameters compensate along a curve therefore seems more detectable than it is.
    """
    if not planted:
        return []
    plain, model = setup.plant, Model(setup.time, setup.shown)
    course = model.course(plain)
    start = model.readings(plain, course)
    knobs = list(base_knobs(setup.layout, plain))
    slopes = model.slopes(plain, course, knobs) * np.array([knob.u for knob in knobs])
    blur = blurred(setup, model, course) if setup.told else None
    if blur is not None:
        slopes = blur.over(np.column_stack([slopes, blur.free]))

    @functools.cache
    def change(plant: Plant) -> Array:
        found = model.readings(plant, model.alike(plain, course, plant)) - start
        return found if blur is None else blur.over(found[:, None])[:, 0]

    there = {one.placed.id for one in planted}
    alone = [change(one.built.plant) for one in planted]
    found = []
    for i, one in enumerate(planted):
        others = [a for j, a in enumerate(alone) if j != i]
        flat = np.array(others).reshape(-1, start.size).T
        rivals = list(_rivals(setup, one, there, seed, change))
        gain = expected_gain(alone[i], slopes, flat)
        found.append((gain, *margin(alone[i], slopes, flat, rivals)))
    return found


def _rivals(
    setup: Setup, one: Planted, there: set[str], seed: int, change: Callable[[Plant], Array]
) -> Iterator[Rival]:
    """Other effects at the place or near it.

    An effect with the same right name, or one that is also planted (`there`), is no rival; of two
    that differ in sign, one is enough.
    """
    plain, names = setup.plant, set(right(setup, one).names)
    near = {one.placed.module, *_around(setup.layout, one.placed)}
    for placed in possible_effects(setup.layout).values():
        if placed.id in there or placed.effect.name in SAME or placed.module not in near:
            continue

        def built(size: float, placed: Placed = placed) -> Built:
            return make(setup, plain, placed, size, seed)

        def changed(size: float, built: Callable[[float], Built] = built) -> Array | None:
            try:
                return change(built(size).plant)
            except RuntimeError:  # so large that the plant has no course
                return None

        low, high = placed.effect.low, placed.effect.high
        moderate = built(math.sqrt(low * high))
        if not names & set(right(setup, replace(one, placed=placed, built=moderate)).names):
            yield Rival(placed.id, low, high, changed)


def _around(layout: Layout, placed: Placed) -> set[str]:
    """Modules near a place: its tank, its feed if it is the first, the next sensor below."""
    tank = layout.tanks[0] if placed.effect.at == "feed" else placed.place
    below = layout.tanks[layout.tanks.index(tank) :]
    sensor = next(t for t in below if t in layout.measured)
    feed = {layout.feed} if tank == layout.tanks[0] or len(layout.measured) == 1 else set()
    return {tank, f"{sensor}{SENSOR}", *feed}


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
