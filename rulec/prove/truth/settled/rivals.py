"""Rivals of an effect: how much better the truth explains the readings than any of them."""

from __future__ import annotations

from collections.abc import Iterator

from ..detection_limit import Rival, margin
from ..units import Array
from .detection_limit import VisibleOutputs
from .effect import EFFECTS, Made, Placed, places_of
from .effect_size import made_of
from .solve import Stalled

MIRRORS = ({"worn", "fouling"}, {"late", "open-seat"})
"""A line that passes more and more, and one that passes less; a valve that opens late, and one that
never shuts."""

SHAPES = 5
"""Shapes of a rival that are tried, such as the pressure at which a valve opens."""


def margin_of(
    seen: VisibleOutputs, placed: Placed, made: Made, flat: Array, seed: int
) -> tuple[float, str]:
    """Return the expected gain over the best other effect nearby, and the name of that one."""
    change, rivals = seen.change(made.changes), list(_rivals(seen, placed, seed))
    return margin(change, seen.sensitivities, flat, rivals)


def _rivals(seen: VisibleOutputs, placed: Placed, seed: int) -> Iterator[Rival]:
    """Other effects in the module, in what it feeds or what feeds it, each in some shapes."""
    rig = seen.scene.rig
    near = {placed.module, *rig.path(placed.module)}
    near |= {m for m in rig.pumps if placed.module in rig.path(m)}
    for effect in EFFECTS.values():
        for other in places_of(rig, effect):
            if other.module not in near or other == placed or _mirrored(placed, other):
                continue
            shapes = set()
            # All faults begin at the same time, so a rival fault has one shape.
            for drawn in range(seed, seed + (1 if effect.sort == "fault" else SHAPES)):
                size = (effect.low * effect.high) ** 0.5
                fixed = made_of(seen.scene, other, size, drawn).fixed.values()
                shape = tuple(value for value in fixed if isinstance(value, float))
                if shape not in shapes:
                    shapes.add(shape)
                    # A change by orders of magnitude cannot be a small effect, scaled up.
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
    """Whether it is the same with the other sign; rivals may have either sign anyway."""
    if {one.effect.name, other.effect.name} in MIRRORS and one.module == other.module:
        return True
    faults = one.effect.sort == other.effect.sort == "fault"
    return faults and one.places == other.places
