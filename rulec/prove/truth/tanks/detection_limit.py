"""The limit of detection of each planted effect, and its margin over other effects."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..detection_limit import Rival, expected_gain, margin
from ..units import Array
from .case import Case
from .effect import Built
from .effect_size import Planted, make
from .effects import SENSOR, Placed, possible_effects
from .hard_detection_limit import blurred
from .model import Model
from .plant import Plant
from .right_answer import right
from .varied_parameters import base_knobs

SAME = ("offset-low", "gain-high", "gain-low", "drift-down", "power-low")
"""No rivals: mirror images of other effects, or the gain that is fitted anyway."""


@dataclass(frozen=True)
class DetectionLimit:
    """See `sealed.Planted`."""

    gain: float
    margin: float
    rival: str


def detection_limits(case: Case) -> tuple[DetectionLimit, ...]:
    """Return the limit of each planted effect while the others may have any size.

    All is linear at the plant without effects: changes, derivatives and rivals must be taken at one
    point, or the difference between two points could pass for any effect. A large effect that
    parameters compensate along a curve therefore seems more detectable than it is.
    """
    if not case.planted:
        return ()
    plain, model = case.setup.plant, Model(case.setup.time, case.setup.shown)
    course = model.course(plain)
    start = model.readings(plain, course)
    knobs = list(base_knobs(case.setup.layout, plain))
    slopes = model.slopes(plain, course, knobs) * np.array([knob.u for knob in knobs])
    blur = blurred(case.setup, model, course) if case.setup.told else None
    if blur is not None:
        slopes = blur.over(np.column_stack([slopes, blur.free]))

    @functools.cache
    def change(plant: Plant) -> Array:
        found = model.readings(plant, model.alike(plain, course, plant)) - start
        return found if blur is None else blur.over(found[:, None])[:, 0]

    alone = [change(one.built.plant) for one in case.planted]
    found = []
    for i, one in enumerate(case.planted):
        others = [a for j, a in enumerate(alone) if j != i]
        flat = np.array(others).reshape(-1, start.size).T
        rivals = list(_rivals(case, one, change))
        gain = expected_gain(alone[i], slopes, flat)
        found.append(DetectionLimit(gain, *margin(alone[i], slopes, flat, rivals)))
    return tuple(found)


def _rivals(case: Case, one: Planted, change: Callable[[Plant], Array]) -> Iterator[Rival]:
    """Other effects at the place or near it.

    An effect with the same right name, or one that is also planted, is no rival; of two that differ
    in sign, one is enough.
    """
    plain, names = case.setup.plant, set(right(case.setup, one).names)
    planted = {p.placed.id for p in case.planted}
    near = {one.placed.module, *_around(case, one.placed)}
    for placed in possible_effects(case.setup.layout).values():
        if placed.id in planted or placed.effect.name in SAME or placed.module not in near:
            continue

        def built(size: float, placed: Placed = placed) -> Built:
            return make(case.scene, plain, placed, size, case.drawn)

        def changed(size: float, built: Callable[[float], Built] = built) -> Array | None:
            try:
                return change(built(size).plant)
            except RuntimeError:  # so large that the plant has no course
                return None

        low, high = placed.effect.low, placed.effect.high
        moderate = built(math.sqrt(low * high))
        if not names & set(right(case.setup, replace(one, placed=placed, built=moderate)).names):
            yield Rival(placed.id, low, high, changed)


def _around(case: Case, placed: Placed) -> set[str]:
    """Modules near a place: its tank, its feed if it is the first, the next sensor below."""
    layout = case.setup.layout
    tank = layout.tanks[0] if placed.effect.at == "feed" else placed.place
    below = layout.tanks[layout.tanks.index(tank) :]
    sensor = next(t for t in below if t in layout.measured)
    feed = {layout.feed} if tank == layout.tanks[0] or len(layout.measured) == 1 else set()
    return {tank, f"{sensor}{SENSOR}", *feed}
