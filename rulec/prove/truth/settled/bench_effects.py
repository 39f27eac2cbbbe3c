"""Physics of a metered centrifugal pump: cavitation, part load, wear rings, fouled passages."""

from __future__ import annotations

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, Array
from .effect import Effect, Made, middle, quantile
from .scene import Scene
from .solve import Operated
from .term import State, Term

AMBIENT, VAPOUR = 1.013 * BAR, 0.0234 * BAR
"""Pressure of the air, and of the vapour of water at 20 degC. Source: IAPWS, saturation line."""

MOST = 0.9
"""Share of the head that is lost at most; then the pump only churns."""


def _lost(share: Array, state: State) -> Array:
    """Pressure missing where a share of the head is lost; `state.pressure` is what is left."""
    kept = 1.0 - np.minimum(share, MOST)
    return np.asarray(state.pressure * (1.0 / kept - 1.0))


def cavitation(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Below a required pressure over that of the vapour the head falls; size per bar."""
    available = scene.suction[module] + AMBIENT - VAPOUR
    required = quantile(scene, available, float(random.uniform(0.2, 0.5)))
    share = size * np.maximum(required - available, 0.0) / BAR
    limit = (required - AMBIENT + VAPOUR) / BAR
    law = Term("head", module, lambda s: _lost(share, s))
    return Made((law,), {"k": size, "p_c": limit})


def npsh(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """What is required rises with the square of the speed."""
    available = scene.suction[module] + AMBIENT - VAPOUR
    usual = middle(scene, scene.given[f"{module}.n"])
    required = quantile(scene, available, float(random.uniform(0.25, 0.5)))

    def law(s: State) -> Array:
        short = np.maximum(required * (s.speed / usual) ** 2 - available, 0.0)
        return _lost(size * short / BAR, s)

    limit = (required - AMBIENT + VAPOUR) / BAR
    return Made((Term("head", module, law),), {"k": size, "p_c": limit, "p_r": required / BAR})


def part_load_head(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Below a flow liquid circulates, and the head is lower, or higher."""
    limit = quantile(scene, scene.given[f"{module}.Q"], float(random.uniform(0.3, 0.6)))
    signed = size * float(random.choice([-0.5, 1.0]))

    def law(s: State) -> Array:
        return _lost(signed * np.maximum(1.0 - s.flow / limit, 0.0), s)

    values = {"k": signed, "Q_c": limit / LITRE_PER_HOUR}
    return Made((Term("head", module, law),), values)


def part_load_power(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Below a flow liquid circulates and takes power."""
    limit = quantile(scene, scene.given[f"{module}.Q"], float(random.uniform(0.3, 0.6)))

    def law(s: State) -> Array:
        return np.asarray(s.power * size * np.maximum(1.0 - s.flow / limit, 0.0))

    return Made((Term("power", module, law),), {"k": size, "Q_c": limit / LITRE_PER_HOUR})


def worn_rings(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """They widen; size is what flows back at the end of the recording, l/h at the median head."""
    usual, length = middle(scene, scene.plain[f"{module}.dp"]), scene.length
    flow = size * LITRE_PER_HOUR * scene.time / length

    def law(s: State) -> Array:
        return np.asarray(flow * np.sqrt(np.maximum(s.pressure, 0.0) / usual))

    return Made((Term("slip", module, law),), {"w": size / scene.days})


def narrowed(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Passages foul: the liquid in them is faster by the share `size` at the end.

    The head is that of so much more flow. No flow comes back, so the power is that of the flow that
    leaves: the head is lost in the passages.
    """
    faster = 1.0 + size * scene.time / scene.length
    own = Operated(scene.rig, scene.values, scene.given).parameters(module)
    head = scene.rig.kind(module).head
    assert head is not None

    def law(s: State) -> Array:
        return np.asarray(head(own, s.speed, s.flow) - head(own, s.speed, faster * s.flow))

    return Made((Term("head", module, law),), {"w": size / scene.days})


METERED = ("metered",)
EFFECTS = (
    Effect("cavitation", "cavitates at low suction pressure", "physics", 1e-2, 3.0, cavitation,
           kinds=METERED, corner=True),
    Effect("npsh", "cavitates the sooner the faster", "physics", 1e-2, 2.5, npsh, kinds=METERED,
           corner=True),
    Effect("part-load-head", "head bends at part load", "physics", 2e-3, 0.5, part_load_head,
           kinds=METERED, corner=True),
    Effect("part-load-power", "power rises at part load", "physics", 5e-3, 2.0, part_load_power,
           kinds=METERED, corner=True),
    Effect("worn-rings", "wear rings widen", "physics", 1.0, 400.0, worn_rings, kinds=METERED,
           timed=True, slow=True),
    Effect("narrowed", "passages of the impeller foul", "physics", 1e-3, 0.5, narrowed,
           kinds=METERED, timed=True, slow=True),
)  # fmt: skip
