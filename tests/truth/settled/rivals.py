"""What else could look like an effect: how much better the truth explains it than any rival."""

from __future__ import annotations

import math

import numpy as np

from ..units import Array
from .effect import Made
from .effects import EFFECTS, Placed, key, places_of
from .scene import Stalled
from .sized import made_of
from .visible import Sight


def margin_of(
    seen: Sight, placed: Placed, made: Made, flat: Array | None, seed: int
) -> tuple[float, str]:
    """Expected gain over the best other effect in the same module or what it feeds."""
    rig = seen.scene.rig
    near = {placed.module, *rig.path(placed.module)}
    near |= {m for m in rig.pumps if placed.module in rig.path(m)}
    least, rival = math.inf, ""
    for effect in EFFECTS.values():
        for other in places_of(rig, effect):
            if other.module not in near or other == placed or _mirrored(placed, other):
                continue
            tried = _rough(seen, other, seed)
            if tried is None:
                continue
            columns = tried[:, None] if flat is None else np.column_stack([flat, tried])
            gain = seen.gain(made.changes, columns)
            if gain < least:
                least, rival = gain, f"{other.module}.{effect.name}"
    return least, rival


def _mirrored(one: Placed, other: Placed) -> bool:
    """Is it the same with the other sign? A direction that is free in sign would not tell them."""
    faults = one.effect.sort == other.effect.sort == "fault"
    places = [key()[placed.effect.name]["places"] for placed in (one, other)]
    return faults and one.module == other.module and places[0] == places[1]


def _rough(seen: Sight, placed: Placed, seed: int) -> Array | None:
    """What another effect would change, of moderate size; None where it cannot be."""
    size = math.sqrt(placed.effect.low * placed.effect.high)
    try:
        return seen.change(made_of(seen.scene, placed, size, seed).changes)
    except Stalled:
        return None
