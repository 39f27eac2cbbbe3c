"""What else could look like an effect: how much better the truth explains it than any rival."""

from __future__ import annotations

from collections.abc import Iterator

from ..limit import Rival, margin
from ..units import Array
from .effect import Made
from .effects import EFFECTS, Placed, entry_of, places_of
from .sized import made_of
from .solve import Stalled
from .visible import VisibleOutputs

MIRRORS = ({"worn", "fouling"}, {"late", "open-seat"})
"""A line that lets more and more through, and one that lets less through; a valve that opens late,
and one that never shuts."""

SHAPES = 5
"""Shapes of a rival that are tried, such as where a valve opens."""


def margin_of(
    seen: VisibleOutputs, placed: Placed, made: Made, flat: Array, seed: int
) -> tuple[float, str]:
    """Expected gain over the best other effect in the same module or what it feeds."""
    return margin(
        seen.change(made.changes), seen.sensitivities, flat, list(_rivals(seen, placed, seed))
    )


def _rivals(seen: VisibleOutputs, placed: Placed, seed: int) -> Iterator[Rival]:
    """Other effects that are near, each in some shapes."""
    rig = seen.scene.rig
    near = {placed.module, *rig.path(placed.module)}
    near |= {m for m in rig.pumps if placed.module in rig.path(m)}
    for effect in EFFECTS.values():
        for other in places_of(rig, effect):
            if other.module not in near or other == placed or _mirrored(placed, other):
                continue
            shapes = set()
            # All faults begin at the same time: what else could have begun then is the rival.
            for drawn in range(seed, seed + (1 if effect.sort == "fault" else SHAPES)):
                size = (effect.low * effect.high) ** 0.5
                shape = tuple(made_of(seen.scene, other, size, drawn).parameters.items())
                if shape not in shapes:
                    shapes.add(shape)
                    # What is off by orders of magnitude is no small effect made as large.
                    yield _rival(seen, other, drawn, placed.effect.whole)


def _rival(seen: VisibleOutputs, placed: Placed, seed: int, bounded: bool) -> Rival:
    def change(size: float) -> Array | None:
        try:
            return seen.change(made_of(seen.scene, placed, size, seed).changes)
        except Stalled:
            return None

    effect = placed.effect
    return Rival(f"{placed.module}.{effect.name}", effect.low, effect.high, change, bounded)


def _mirrored(one: Placed, other: Placed) -> bool:
    """Is it the same with the other sign? A direction that is free in sign would not tell them."""
    if {one.effect.name, other.effect.name} in MIRRORS and one.module == other.module:
        return True
    faults = one.effect.sort == other.effect.sort == "fault"
    places = [entry_of(placed.effect.name)["places"] for placed in (one, other)]
    return faults and one.module == other.module and places[0] == places[1]
