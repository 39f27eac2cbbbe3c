"""How well each planted effect can be seen, and told from other effects, at best."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..limit import expected_gain, margin
from ..units import Array
from .case import Case
from .effects import SENSOR, Placed, possible_effects
from .key import right
from .knobs import base_knobs
from .model import Model
from .plant import Plant
from .size import Planted, make, plant_all

SAME = ("offset-low", "gain-high", "gain-low", "drift-down", "power-low")
"""No rivals: the mirror image of another effect, or the gain that is fitted anyway."""


@dataclass(frozen=True)
class Seen:
    """See `sealed.Planted`."""

    gain: float
    margin: float
    rival: str


def seen(case: Case) -> tuple[Seen, ...]:
    """Of each planted effect, the others being there with any size.

    All is linear about the plant without the one effect: slopes, rivals and others must be taken
    at one point, or what lies between two points can pass for any effect.
    """
    return tuple(_seen(case, one) for one in case.planted)


def _seen(case: Case, one: Planted) -> Seen:
    scene, model = case.scene, Model(case.setup.time, case.setup.shown)
    others = [p for p in case.planted if p is not one]
    base = plant_all(scene, others, case.drawn)
    course = model.course(base)
    start = model.readings(base, course)

    def change(plant: Plant) -> Array:
        return model.readings(plant, model.alike(base, course, plant)) - start

    less = [plant_all(scene, [o for o in others if o is not p], case.drawn) for p in others]
    flat = np.array([change(plant) for plant in less]).reshape(-1, start.size).T
    knobs = list(base_knobs(case.setup.layout, base))
    slopes = model.slopes(base, course, knobs) * np.array([knob.u for knob in knobs])
    d = change(case.plant)
    rivals = {name: change(plant) for name, plant in _rivals(case, one, base)}
    left, nearest = margin(d, slopes, flat, rivals)
    return Seen(expected_gain(d, slopes, flat), left, nearest)


def _rivals(case: Case, one: Planted, base: Plant) -> Iterator[tuple[str, Plant]]:
    """Plants with another effect in the place or beside it, each at a moderate size.

    An effect that would rightly get the same name, or is planted too, is no rival; of two that
    differ in sign one is enough.
    """
    scene, names = case.scene, set(right(case.setup, one).names)
    planted = {p.placed.id for p in case.planted}
    for placed in possible_effects(case.setup.layout).values():
        known = placed.id in planted or placed.effect.name in SAME
        if known or not _is_near(case, one.placed, placed):
            continue
        size = math.sqrt(placed.effect.low * placed.effect.high)
        built = make(scene, base, placed, size, case.drawn)
        if not names & set(right(case.setup, replace(one, placed=placed, built=built)).names):
            yield placed.id, built.plant


def _is_near(case: Case, here: Placed, there: Placed) -> bool:
    """In the same tank, at the sensor that sees it first, or at what feeds it."""
    return bool(_around(case, here) & {there.module}) or there.module == here.module


def _around(case: Case, placed: Placed) -> set[str]:
    """Modules beside a place: its tank, its feed if it is the first, the next sensor below."""
    layout = case.setup.layout
    tank = layout.tanks[0] if placed.effect.at == "feed" else placed.place
    below = layout.tanks[layout.tanks.index(tank) :]
    sensor = next(t for t in below if t in layout.measured)
    feed = {layout.feed} if tank == layout.tanks[0] or len(layout.measured) == 1 else set()
    return {tank, f"{sensor}{SENSOR}", *feed}
