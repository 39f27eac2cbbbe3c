"""The size of an effect, so that it changes the readings as planned."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..streams import stream
from ..units import Array
from .balance import Course, integrate
from .build import Setup
from .effect import Built, Here, Placed, made
from .plant import Plant
from .sensing import shown

LEAST, MOST = 0.3, 1.0
"""V; range of the target: RMS change by the effect alone of the reading that shows it most."""

ACCEPTED = 0.15, 1.5
"""V; accepted change if the range of sizes ends before the target."""

VISIBLE = 0.02, 2.5
"""V; accepted change if a given strength cannot be reached."""

FAINT = 20.0
"""Factor by which the least size is reduced if a strength is given."""

NEAR = 1.2
"""Factor to the target within which the search ends."""

TRIES = 8

LOWEST, HIGHEST = -0.2, 9.9
"""V; range of a sensor, which readings must not leave."""

Readings = Mapping[str, Array]
"""Voltages by tank."""


@dataclass(frozen=True)
class Planted:
    """An effect with its size, and its change of the readings alone."""

    placed: Placed
    size: float
    built: Built
    change: Readings


def plant_each(
    setup: Setup, wanted: Sequence[Placed], seed: int, strength: float | None
) -> list[Planted] | None:
    """Size each effect alone for a drawn change; None if the plant cannot show one of them.

    `strength`, V, replaces the drawn change; if the plant cannot show it, the nearest is taken.
    """
    drawn = float(stream(seed, "aim").uniform(NEAR * LEAST, MOST / NEAR))
    plain = shown(setup.plant, setup.course)
    found = []
    for placed in wanted:
        if strength is None:
            aim, accepted = drawn * placed.effect.scale, ACCEPTED
        else:
            placed = replace(placed, effect=replace(placed.effect, low=placed.effect.low / FAINT))
            aim, accepted = strength, VISIBLE
        one = _sought(setup, plain, placed, aim, accepted, seed)
        if one is None:
            return None
        found.append(one)
    return found


def run(setup: Setup, plant: Plant) -> Course:
    """Simulate a plant; if only sensors err, the course is that of the setup."""
    plain = setup.plant
    same = (plant.feed, plant.tanks) == (plain.feed, plain.tanks)
    if same and not any(s["lag"] or s["dead_time"] for s in plant.sensors.values()):
        return setup.course
    return integrate(plant, setup.time, setup.shown)


def change_of(readings: Readings, plain: Readings) -> dict[str, Array]:
    """Return the change of the readings by tank."""
    return {tank: readings[tank] - plain[tank] for tank in plain}


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def most(change: Readings) -> float:
    """Return the RMS change of the reading that changes most, V."""
    return max(rms(values) for values in change.values())


def is_inside(plant: Plant, course: Course) -> bool:
    """Return whether all readings are within the range of their sensors."""
    values = shown(plant, course).values()
    return all(v.min() >= LOWEST and v.max() <= HIGHEST for v in values)


def _sought(
    setup: Setup,
    plain: Readings,
    placed: Placed,
    aim: float,
    accepted: tuple[float, float],
    seed: int,
) -> Planted | None:
    """Search the size with the target change: within bounds, by the ratio to the target."""
    low, high = placed.effect.low, placed.effect.high
    largest, size, best, least = high, math.sqrt(low * high), None, math.inf
    for _ in range(TRIES):
        built = make(setup, setup.plant, placed, size, seed)
        course = run(setup, built.plant)
        change = change_of(shown(built.plant, course), plain)
        reached = max(most(change), 1e-3 * aim)
        off = abs(math.log(reached / aim))
        inside = is_inside(built.plant, course)
        low, high = (size, high) if inside and reached < aim else (low, size)
        if inside and off < least:
            best, least = Planted(placed, size, built, change), off
        if least < math.log(NEAR) or high / low < 1.02:
            break
        guess = size * aim / reached
        if low * 1.01 < guess < high / 1.01:
            size = guess
        else:
            size = high if guess >= high == largest else math.sqrt(low * high)
    if best is None or not accepted[0] <= most(best.change) <= accepted[1]:
        return None
    return best


def make(setup: Setup, plant: Plant, placed: Placed, size: float, seed: int) -> Built:
    """Make an effect of some size; its shape is the same at every size."""
    return made(placed, Here(size, stream(seed, placed.id), setup, plant, placed.place))
