"""Physics of a control valve: what its trim is, what chokes in it, what stands in row with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..units import BAR, Array
from .bench_effects import AMBIENT, VAPOUR
from .effect import Effect, Made, middle, quantile
from .scene import Scene
from .term import State, Term

CRITICAL = 0.96 - 0.28 * (VAPOUR / 220.64e5) ** 0.5
"""Pressure in the jet, over that of the vapour, where it chokes. Source: IEC 60534-2-1, FF."""


def _opened(module: str, opening: Callable[[Array], Array]) -> Term:
    """A valve that is open by another share than its travel; the plain law is linear in that."""
    return Term("shaft", module, lambda s: np.asarray(1.0 - opening(s.speed) / s.speed))


def percentage(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Equal steps of travel change the flow by equal shares; `size` is part of the way there."""
    ratio = float(random.uniform(20.0, 60.0))
    law = _opened(module, lambda x: x + size * (ratio ** (x - 1.0) - x))
    return Made((law,), {"s": size, "R": ratio})


def quick(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A flat plug: the flow rises with a power of the travel below 1, at most with its root."""
    return Made((_opened(module, lambda x: x ** (1.0 - size)),), {"m": size})


def open_seat(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """At no travel the share `size` is open; the rest opens in proportion to the travel."""
    return Made((_opened(module, lambda x: size + (1.0 - size) * x),), {"r": size})


def late(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The first part of the travel, `size`, opens nothing."""
    law = _opened(module, lambda x: np.asarray(np.maximum(x - size, 0.0)))
    return Made((law,), {"d": size})


def stopped(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A stop in the way: the valve opens no further; `size` is how often it would have to."""
    limit = quantile(scene, scene.given[f"{module}.x"], 1.0 - size)
    law = _opened(module, lambda x: np.asarray(np.minimum(x, limit)))
    return Made((law,), {"s": limit})


def heavy(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The loss follows the density; `size` is 1 for turbulent flow, less where that is partly so.

    The flow coefficient holds at the median density.
    """
    ratio = scene.density[module] / middle(scene, scene.density[module])
    return Made((Term("gain", module, lambda s: 1.0 - ratio ** (-0.5 * size)),), {"s": size})


def choked(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The jet is faster than what leaves, by the root of 1 + size: it boils the sooner."""
    before = scene.suction[module] + AMBIENT - CRITICAL * VAPOUR
    largest = before / (1.0 + size)

    def law(s: State) -> Array:
        return np.asarray(1.0 - np.sqrt(np.minimum(s.pressure, largest) / s.pressure))

    values = {"F": 1.0 / (1.0 + size), "p_v": (AMBIENT - CRITICAL * VAPOUR) / BAR}
    return Made((Term("gain", module, law),), values)


def in_row(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Fittings between the taps lose pressure too, by the square of the flow.

    `size` is their loss over the valve's where that passes the median flow at the median pressure.
    """
    flow = middle(scene, scene.plain[f"{module}.Q"])
    pressure = middle(scene, scene.given[f"{module}.dp"])
    fittings = size * pressure / flow**2
    coefficient, reference = (scene.values[f"{module}.{name}"] for name in ("Kv", "p_ref"))

    def law(s: State) -> Array:
        valve = reference / (coefficient * s.speed) ** 2
        return np.asarray(1.0 - np.sqrt(valve / (valve + fittings)))

    return Made((Term("gain", module, law),), {"k": size})


VALVES = ("valve",)
EFFECTS = (
    Effect("percentage", "equal-percentage trim", "physics", 1e-3, 1.0, percentage, kinds=VALVES),
    Effect("quick", "quick-opening trim", "physics", 1e-3, 0.5, quick, kinds=VALVES),
    Effect("open-seat", "valve never shuts", "physics", 1e-3, 0.3, open_seat, kinds=VALVES),
    Effect("late", "travel that opens nothing", "physics", 1e-3, 0.07, late, kinds=VALVES),
    Effect("stopped", "travel ends early", "physics", 0.02, 0.7, stopped, kinds=VALVES,
           corner=True),
    Effect("heavy", "loss follows the density", "physics", 1e-3, 1.0, heavy, kinds=VALVES,
           driver="rho"),
    Effect("choked", "flow chokes", "physics", 0.02, 4.0, choked, kinds=VALVES, corner=True),
    Effect("in-row", "fittings in row with the valve", "physics", 1e-3, 3.0, in_row, kinds=VALVES),
)  # fmt: skip
