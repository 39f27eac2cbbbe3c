"""Physics that no catalogue names; the right answer is its place."""

from __future__ import annotations

import numpy as np

from ..units import RPM
from .effect import DOSING, STROKES, Effect, Here, Made, quantile, span


def resonance(here: Here) -> Made:
    """In a band of speeds the frame shakes and takes power; size over the median power."""
    speed, peak = here.plain("n"), here.limit("n", 0.35, 0.65)
    width = 0.12 * span(here.scene, speed)
    bump = here.size * here.usual("P_el") * np.exp(-(((speed - peak) / width) ** 2))
    return here.constant("power", bump, peak=peak / RPM)


def play(here: Here) -> Made:
    """A valve has play: friction depends on whether the flow was raised or lowered."""
    speed = here.plain("n")
    state, last = np.zeros_like(speed), float(speed[0])
    side = 1.0
    for k, now in enumerate(speed):
        if abs(now - last) > 0.02 * span(here.scene, speed):
            side, last = float(np.sign(now - last)), float(now)
        state[k] = side
    return here.constant("friction", here.size * state, share=here.size)


def beside(here: Here) -> Made:
    """A machine beside the pump, which nobody records, shakes its valves periodically."""
    period, phase = here.between(120.0, 300.0), here.between(0.0, 2.0 * np.pi)
    wave = 0.5 * (1.0 + np.sin(2.0 * np.pi * here.scene.time / period + phase))
    return here.constant("gain", here.size * wave, share=here.size, period=period)


def pattern(here: Here) -> Made:
    """The flow pattern in a mixer changes if one feed outweighs the others."""
    rig = here.scene.rig
    feeding = [n for n in rig.pumps if here.module in rig.path(n)]
    flows = np.array([here.scene.plain[f"{n}.Q"] for n in feeding])
    share = flows[0] / flows.sum(axis=0)
    over = (share > quantile(here.scene, share, 0.55)).astype(float)
    return here.constant("friction", here.size * over, share=here.size)


EFFECTS = (
    Effect("resonance", "frame shakes in a band of speeds", 2e-3, 1.0, resonance, "unnamed",
           kinds=DOSING),
    Effect("play", "friction depends on the way there", 1e-3, 0.5, play, "unnamed", kinds=DOSING),
    Effect("beside", "a machine beside shakes the valves", 1e-3, 0.4, beside, "unnamed",
           kinds=STROKES),
    Effect("pattern", "flow pattern in the mixer", 2e-3, 1.0, pattern, "unnamed", at="mixer"),
)  # fmt: skip
