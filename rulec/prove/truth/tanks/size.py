"""How large an effect is made: so large that it shows as it should, in the plant it is put into."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..streams import stream
from ..units import Array
from .balance import Course, integrate
from .effect import Built, Here, Scene
from .effects import Placed
from .plant import Plant
from .sensing import shown

LEAST, MOST = 0.3, 1.0
"""V; what an effect should change alone, root mean square of the reading that shows it most."""

ACCEPTED = 0.15, 1.5
"""V; what is taken where a size ends before that."""

VISIBLE = 0.02, 2.5
"""V; what is taken where a strength is asked for and cannot be reached."""

FAINT = 20.0
"""A faint effect may be smaller than its usual least size by this factor."""

NEAR = 1.2
"""Factor to the aim that is near enough."""

TRIES = 8

LOWEST, HIGHEST = -0.2, 9.9
"""V; no reading leaves the range of its sensor without an effect that says so."""

Readings = Mapping[str, Array]
"""Voltages by tank."""


@dataclass(frozen=True)
class Planted:
    """An effect with its size found, and what it changes alone."""

    placed: Placed
    size: float
    built: Built
    change: Readings


def plant_each(
    scene: Scene, wanted: Sequence[Placed], seed: int, strength: float | None = None
) -> list[Planted] | None:
    """Each effect alone, as large as drawn; None where one cannot be seen in this plant.

    `strength`, V, replaces what is drawn; where the plant cannot show it, what is nearest.
    """
    drawn = float(stream(seed, "aim").uniform(NEAR * LEAST, MOST / NEAR))
    plain = shown(scene.setup.plant, scene.course)
    found = []
    for placed in wanted:
        if strength is None:
            aim, accepted = drawn * placed.effect.scale, ACCEPTED
        else:
            placed = replace(placed, effect=replace(placed.effect, low=placed.effect.low / FAINT))
            aim, accepted = strength, VISIBLE
        one = _sought(scene, plain, placed, aim, accepted, seed)
        if one is None:
            return None
        found.append(one)
    return found


def plant_all(scene: Scene, planted: Sequence[Planted], seed: int) -> Plant:
    """The plant with all effects, each as it is alone."""
    plant = scene.setup.plant
    for one in planted:
        plant = make(scene, plant, one.placed, one.size, seed).plant
    return plant


def run(scene: Scene, plant: Plant) -> Course:
    """What happens in a plant; where only a sensor errs, the levels are known already."""
    plain = scene.setup.plant
    same = (plant.feed, plant.tanks) == (plain.feed, plain.tanks)
    if same and not any(s.lag or s.dead_time for s in plant.sensors):
        return scene.course
    return integrate(plant, scene.setup.time, scene.setup.shown)


def change_of(readings: Readings, plain: Readings) -> dict[str, Array]:
    """What was changed, by tank."""
    return {tank: readings[tank] - plain[tank] for tank in plain}


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def most(change: Readings) -> float:
    """Root mean square of the reading that changes most, V."""
    return max(rms(values) for values in change.values())


def is_inside(plant: Plant, course: Course) -> bool:
    """Can the sensors show all that happens?"""
    values = shown(plant, course).values()
    return all(v.min() >= LOWEST and v.max() <= HIGHEST for v in values)


def _sought(
    scene: Scene,
    plain: Readings,
    placed: Placed,
    aim: float,
    accepted: tuple[float, float],
    seed: int,
) -> Planted | None:
    """Seek the size at which an effect shows as aimed: between bounds, by the ratio missed."""
    low, high = placed.effect.low, placed.effect.high
    largest, size, best, least = high, math.sqrt(low * high), None, math.inf
    for _ in range(TRIES):
        built = make(scene, scene.setup.plant, placed, size, seed)
        course = run(scene, built.plant)
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


def make(scene: Scene, plant: Plant, placed: Placed, size: float, seed: int) -> Built:
    """An effect of some size; what shapes it is the same at every size."""
    at, random = placed.effect.at, stream(seed, placed.id)
    return placed.effect.make(Here(scene, plant, at, placed.place, size, random))
