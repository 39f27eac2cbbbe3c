"""Physics of a control valve: its trim, choked flow, fittings in series with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..units import BAR, Array
from .bench_effects import AMBIENT, VAPOUR
from .effect import Effect, Here, Made, middle, quantile
from .term import State

CRITICAL = 0.96 - 0.28 * (VAPOUR / 220.64e5) ** 0.5
"""Pressure in a choked jet over vapour pressure. Source: IEC 60534-2-1, FF."""


def _opened(here: Here, opening: Callable[[Array], Array], **parameters: float) -> Made:
    """A valve whose opening differs from its travel; the plain law is linear in the travel."""
    return here.term("shaft", lambda s: np.asarray(1.0 - opening(s.speed) / s.speed), **parameters)


def percentage(here: Here) -> Made:
    """Equal steps of travel change the flow by equal shares; `size` is the part of this law."""
    ratio = here.between(20.0, 60.0)
    return _opened(here, lambda x: x + here.size * (ratio ** (x - 1.0) - x), s=here.size, R=ratio)


def quick(here: Here) -> Made:
    """A flat plug: the flow rises with a power of the travel between 0.5 and 1."""
    return _opened(here, lambda x: x ** (1.0 - here.size), m=here.size)


def open_seat(here: Here) -> Made:
    """At zero travel the share `size` is open; the rest opens in proportion to the travel."""
    return _opened(here, lambda x: here.size + (1.0 - here.size) * x, r=here.size)


def late(here: Here) -> Made:
    """The first part of the travel, `size`, opens nothing."""
    return _opened(here, lambda x: np.asarray(np.maximum(x - here.size, 0.0)), d=here.size)


def stopped(here: Here) -> Made:
    """A stop limits the opening; `size` is the share of time in which it acts."""
    limit = quantile(here.scene, here.plain("x"), 1.0 - here.size)
    return _opened(here, lambda x: np.asarray(np.minimum(x, limit)), s=limit)


def heavy(here: Here) -> Made:
    """The loss follows the density; `size` is 1 for turbulent flow, less for partly turbulent flow.

    The flow coefficient holds at the median density.
    """
    density = here.scene.density[here.module]
    ratio = density / middle(here.scene, density)
    return here.term("gain", lambda s: 1.0 - ratio ** (-0.5 * here.size), s=here.size)


def choked(here: Here) -> Made:
    """The jet is faster than the outflow by the root of 1 + size, so it boils earlier."""
    before = here.scene.suction[here.module] + AMBIENT - CRITICAL * VAPOUR
    largest = before / (1.0 + here.size)

    def law(s: State) -> Array:
        return np.asarray(1.0 - np.sqrt(np.minimum(s.pressure, largest) / s.pressure))

    values = {"F": 1.0 / (1.0 + here.size), "p_v": (AMBIENT - CRITICAL * VAPOUR) / BAR}
    return here.term("gain", law, **values)


def in_row(here: Here) -> Made:
    """Fittings between the taps also lose pressure, with the square of the flow.

    `size` is their loss over that of the valve at median flow and pressure.
    """
    fittings = here.size * here.usual("dp") / here.usual("Q") ** 2
    coefficient, reference = here.value("Kv"), here.value("p_ref")

    def law(s: State) -> Array:
        valve = reference / (coefficient * s.speed) ** 2
        return np.asarray(1.0 - np.sqrt(valve / (valve + fittings)))

    return here.term("gain", law, k=here.size)


VALVES = ("valve",)
EFFECTS = (
    Effect("percentage", "equal-percentage trim", 1e-3, 1.0, percentage, kinds=VALVES),
    Effect("quick", "quick-opening trim", 1e-3, 0.5, quick, kinds=VALVES),
    Effect("open-seat", "valve never shuts", 1e-3, 0.3, open_seat, kinds=VALVES),
    Effect("late", "travel that opens nothing", 1e-3, 0.07, late, kinds=VALVES),
    Effect("stopped", "travel ends early", 0.02, 0.7, stopped, kinds=VALVES, corner=True),
    Effect("heavy", "loss follows the density", 1e-3, 1.0, heavy, kinds=VALVES, driver="rho"),
    Effect("choked", "flow chokes", 0.02, 4.0, choked, kinds=VALVES, corner=True),
    Effect("in-row", "fittings in row with the valve", 1e-3, 3.0, in_row, kinds=VALVES),
)  # fmt: skip
