"""The size of an effect, so that its expected gain is that of the plan."""

import math

from ..streams import stream
from .detection_limit import VisibleOutputs
from .effect import Here, Made, Placed, made
from .operated_plant import Scene
from .solve import Stalled

TRIES = 14
NEAR = 1.25
"""Factor to the target gain within which the search ends."""

FAR = 4.0
"""Factor to the target gain that is accepted if an effect cannot be larger or smaller."""

LEAST = 4.0
"""Least expected gain of an effect."""


def sized(visible: VisibleOutputs, placed: Placed, aim: float, seed: int) -> Made:
    """Search the size at which an effect has the target gain; one without a size stays as it is.

    Raises Stalled if there is none, or if the plant cannot have the effect.
    """
    low, high = placed.effect.low, placed.effect.high
    size, best, least, reached = math.sqrt(low * high), None, math.inf, 0.0
    for _ in range(TRIES):
        found = made_of(visible.scene, placed, size, seed)
        try:
            gain = visible.gain(found.changes)
        except Stalled:
            high, size = size, math.sqrt(low * size)
            continue
        off = 0.0 if placed.effect.whole else abs(math.log(max(gain, 1e-9) / aim))
        if off < least:
            best, least, reached = found, off, gain
        if off < math.log(NEAR) or high / low < 1.01:
            break
        low, high = (size, high) if gain < aim else (low, size)
        guess = size * math.sqrt(aim / max(gain, 1e-9))
        size = guess if low * 1.005 < guess < high / 1.005 else math.sqrt(low * high)
    if best is None or reached < LEAST or least > math.log(FAR):
        raise Stalled(f"{placed.effect.name} cannot be as strong as planned")
    return best


def made_of(scene: Scene, placed: Placed, size: float, seed: int) -> Made:
    """Make an effect of some size; its shape is the same at every size."""
    # All faults begin at the same time, as rivals that another fault could be taken for.
    fault = placed.effect.sort == "fault"
    name = "fault" if fault else f"{placed.effect.name} {placed.module}"
    return made(placed.effect, Here(size, stream(seed, name), scene, placed.module))
