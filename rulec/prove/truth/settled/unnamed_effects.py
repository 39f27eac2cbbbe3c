"""Physics that no catalogue names; the answer to it is its place."""

from __future__ import annotations

import numpy as np

from ..units import RPM
from .effect import DOSING, Effect, Made, middle, quantile, span
from .scene import Scene
from .term import Term


def resonance(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """In a band of speeds the frame shakes and takes power; size over the median power."""
    speed = scene.given[f"{module}.n"]
    peak = quantile(scene, speed, float(random.uniform(0.35, 0.65)))
    width = 0.12 * span(scene, speed)
    load = middle(scene, scene.plain[f"{module}.P_el"])
    bump = size * load * np.exp(-(((speed - peak) / width) ** 2))
    return Made((Term("power", module, lambda s: bump),), {"peak": peak / RPM})


def play(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A valve with play: friction differs after the flow was raised and after it was lowered."""
    speed = scene.given[f"{module}.n"]
    state, last = np.zeros_like(speed), float(speed[0])
    side = 1.0
    for k, now in enumerate(speed):
        if abs(now - last) > 0.02 * span(scene, speed):
            side, last = float(np.sign(now - last)), float(now)
        state[k] = side
    return Made((Term("friction", module, lambda s: size * state),), {"share": size})


def beside(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A machine beside the pump, which nobody records, shakes its valves, now more, now less."""
    period = float(random.uniform(120.0, 300.0))
    phase = float(random.uniform(0.0, 2.0 * np.pi))
    wave = 0.5 * (1.0 + np.sin(2.0 * np.pi * scene.time / period + phase))
    return Made((Term("gain", module, lambda s: size * wave),), {"share": size, "period": period})


def pattern(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The flow in a mixer changes its pattern where one feed outweighs the others."""
    feeding = [n for n in scene.rig.pumps if module in scene.rig.path(n)]
    flows = np.array([scene.plain[f"{n}.Q"] for n in feeding])
    share = flows[0] / flows.sum(axis=0)
    over = (share > quantile(scene, share, 0.55)).astype(float)
    return Made((Term("friction", module, lambda s: size * over),), {"share": size})


EFFECTS = (
    Effect("resonance", "frame shakes in a band of speeds", "unnamed", 2e-3, 1.0, resonance,
           kinds=DOSING),
    Effect("play", "friction depends on the way there", "unnamed", 1e-3, 0.5, play, kinds=DOSING),
    Effect("beside", "a machine beside shakes the valves", "unnamed", 1e-3, 0.4, beside,
           kinds=("cavity", "membrane")),
    Effect("pattern", "flow pattern in the mixer", "unnamed", 2e-3, 1.0, pattern, at="mixer"),
)  # fmt: skip
