"""The size of an effect, so that its expected gain is that of the plan, and its rivals: how much
better the truth explains the readings than any of them.
"""

import math
from collections.abc import Iterator

from ..detection_limit import Rival, margin
from ..streams import stream
from ..units import Array
from .detection_limit import VisibleOutputs
from .effect import EFFECTS, Here, Made, Placed, made, places_of
from .operated_plant import Scene
from .solve import Stalled

TRIES = 14
NEAR = 1.25
"""Factor to the target gain within which the search ends."""

FAR = 4.0
"""Factor to the target gain that is accepted if an effect cannot be larger or smaller."""

LEAST = 4.0
"""Least expected gain of an effect."""


def sized(seen: VisibleOutputs, placed: Placed, aim: float, seed: int) -> Made | None:
    """Search the size at which an effect has the target gain; None if there is none.

    An effect without a size stays as it is. Raises Stalled if the plant cannot have it.
    """
    effect = placed.effect
    low, high = effect.low, effect.high
    size, best, least = math.sqrt(low * high), None, math.inf
    if effect.whole:
        found = made_of(seen.scene, placed, size, seed)
        return found if seen.gain(found.changes) >= LEAST else None
    for _ in range(TRIES):
        found = made_of(seen.scene, placed, size, seed)
        try:
            gain = seen.gain(found.changes)
        except Stalled:
            high = size
            size = math.sqrt(low * size)
            continue
        off = abs(math.log(max(gain, 1e-9) / aim))
        if off < least:
            best, least, reached = found, off, gain
        if off < math.log(NEAR) or high / low < 1.01:
            break
        low, high = (size, high) if gain < aim else (low, size)
        guess = size * math.sqrt(aim / max(gain, 1e-9))
        size = guess if low * 1.005 < guess < high / 1.005 else math.sqrt(low * high)
    if best is None or reached < LEAST or least > math.log(FAR):
        return None
    return best


def made_of(scene: Scene, placed: Placed, size: float, seed: int) -> Made:
    """Make an effect of some size; its shape is the same at every size."""
    # All faults begin at the same time, as rivals that another fault could be taken for.
    fault = placed.effect.sort == "fault"
    name = "fault" if fault else f"{placed.effect.name} {placed.module}"
    return made(placed.effect, Here(scene, placed.module, size, stream(seed, name)))


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
