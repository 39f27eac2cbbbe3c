"""Physics of a metered centrifugal pump: cavitation, part load, wear rings, fouled passages."""

from __future__ import annotations

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, Array
from .effect import Effect, Here, Made, quantile
from .solve import Operated
from .term import State

AMBIENT, VAPOUR = 1.013 * BAR, 0.0234 * BAR
"""Pressure of the air, and vapour pressure of water at 20 degC. Source: IAPWS, saturation line."""

MOST = 0.9
"""Largest share of the head that is lost; then the pump only churns."""


def _lost(share: Array, state: State) -> Array:
    """Pressure that is lost with a share of the head; `state.pressure` is the rest."""
    kept = 1.0 - np.minimum(share, MOST)
    return np.asarray(state.pressure * (1.0 / kept - 1.0))


def _suction(here: Here, least: float) -> tuple[Array, float]:
    """Pressure above vapour pressure, Pa: available, and required for a share of the time."""
    available = here.scene.suction[here.module] + AMBIENT - VAPOUR
    return available, quantile(here.scene, available, here.between(least, 0.5))


def cavitation(here: Here) -> Made:
    """The head falls below a required pressure above vapour pressure; size per bar."""
    available, required = _suction(here, 0.2)
    share = here.size * np.maximum(required - available, 0.0) / BAR
    limit = (required - AMBIENT + VAPOUR) / BAR
    return here.term("head", lambda s: _lost(share, s), k=here.size, p_c=limit)


def npsh(here: Here) -> Made:
    """The required suction pressure rises with the square of the speed."""
    usual, (available, required) = here.usual("n"), _suction(here, 0.25)

    def law(s: State) -> Array:
        short = np.maximum(required * (s.speed / usual) ** 2 - available, 0.0)
        return _lost(here.size * short / BAR, s)

    limit = (required - AMBIENT + VAPOUR) / BAR
    return here.term("head", law, k=here.size, p_c=limit, p_r=required / BAR)


def part_load_head(here: Here) -> Made:
    """Liquid recirculates below a flow, and the head is lower, or higher."""
    limit, signed = here.limit("Q", 0.3, 0.6), here.signed(-0.5)

    def law(s: State) -> Array:
        return _lost(signed * np.maximum(1.0 - s.flow / limit, 0.0), s)

    return here.term("head", law, k=signed, Q_c=limit / LITRE_PER_HOUR)


def part_load_power(here: Here) -> Made:
    """Liquid recirculates below a flow and takes power."""
    limit = here.limit("Q", 0.3, 0.6)

    def law(s: State) -> Array:
        return np.asarray(s.power * here.size * np.maximum(1.0 - s.flow / limit, 0.0))

    return here.term("power", law, k=here.size, Q_c=limit / LITRE_PER_HOUR)


def worn_rings(here: Here) -> Made:
    """Wear rings widen; size is the leakage flow at the end, l/h at the median head."""
    scene, usual = here.scene, here.usual("dp")
    flow = here.size * LITRE_PER_HOUR * scene.time / scene.length

    def law(s: State) -> Array:
        return np.asarray(flow * np.sqrt(np.maximum(s.pressure, 0.0) / usual))

    return here.term("slip", law, w=here.per_day)


def narrowed(here: Here) -> Made:
    """Passages foul: the liquid in them is faster by the share `size` at the end.

    The head is that of a flow that is larger by this share. No flow returns, so the power is that
    of the delivered flow: the head is lost in the passages.
    """
    faster, scene = 1.0 + here.grown, here.scene
    own = Operated(scene.rig, scene.values, scene.given).parameters(here.module)
    head = scene.rig.kind(here.module).head
    assert head is not None

    def law(s: State) -> Array:
        return np.asarray(head(own, s.speed, s.flow) - head(own, s.speed, faster * s.flow))

    return here.term("head", law, w=here.per_day)


METERED = ("metered",)
EFFECTS = (
    Effect("cavitation", "cavitates at low suction pressure", 1e-2, 3.0, cavitation,
           kinds=METERED, corner=True),
    Effect("npsh", "cavitates the sooner the faster", 1e-2, 2.5, npsh, kinds=METERED, corner=True),
    Effect("part-load-head", "head bends at part load", 2e-3, 0.5, part_load_head, kinds=METERED,
           corner=True),
    Effect("part-load-power", "power rises at part load", 5e-3, 2.0, part_load_power,
           kinds=METERED, corner=True),
    Effect("worn-rings", "wear rings widen", 1.0, 400.0, worn_rings, kinds=METERED, timed=True,
           slow=True),
    Effect("narrowed", "passages of the impeller foul", 1e-3, 0.5, narrowed, kinds=METERED,
           timed=True, slow=True),
)  # fmt: skip
