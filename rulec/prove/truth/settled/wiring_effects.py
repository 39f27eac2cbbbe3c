"""Mistakes of wiring and files: they hold from the first sample to the last, and no physics is
beyond the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..transients import late
from ..units import BAR, Array
from .effect import DOSING, Effect, Made, Make
from .scene import Scene
from .solve import Stalled
from .term import Column, Reading

UNITS: Mapping[str, tuple[float, ...]] = {
    "dp": (14.5038, 100.0, 0.1),  # psi, kPa and MPa as bar
    "P_el": (1e-3, 1.0 / 745.7),  # kW and hp as W
    "n": (1.0 / 60.0, 2.0 * np.pi / 60.0),  # rev/s and rad/s as rpm
}
"""Factors of what stands in a column in another unit than its header says, by signal."""

NAMES = {"dp": "dp", "P_el": "power", "n": "speed"}
"""Of signals in names of effects."""

ZERO = {"dp": 0.3 * BAR, "P_el": 60.0}
"""Offset of a misadjusted meter where its gain is off by all, SI."""


def _unit(signal: str) -> Make:
    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        factor = float(random.choice(UNITS[signal]))
        place = f"{module}.{signal}"
        return Made((Column(place, lambda c: c[place] * factor),), {"factor": factor})

    return make


def turned(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The taps of a pressure difference are exchanged."""
    place = f"{module}.dp"
    return Made((Column(place, lambda c: -c[place]),), {})


def _swapped(signal: str) -> Make:
    """The column of one pump holds what belongs to another, and the reverse."""

    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        others = [m for m in scene.rig.pumps if m != module]
        if not others:
            raise Stalled("no other pump whose column could be taken")
        one, other = f"{module}.{signal}", f"{random.choice(others)}.{signal}"
        changes = Column(one, lambda c: c[other]), Column(other, lambda c: c[one])
        return Made(changes, {}, (other,))

    return make


def _late(signal: str) -> Make:
    """A column comes from a recorder whose clock is behind, by `size` samples."""

    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        by = max(round(size), 1)
        place = f"{module}.{signal}"
        return Made((Column(place, lambda c: late(c[place], by)),), {"shift": by * scene.pace})

    return make


def _misadjusted(signal: str) -> Make:
    """A meter with a wrong zero and a wrong gain, against all others."""

    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        gain, zero = (size * float(random.choice([-1.0, 1.0])) for _ in range(2))

        def shown(value: Array) -> Array:
            return value * (1.0 + gain) + zero * ZERO[signal]

        return Made((Reading(f"{module}.{signal}", shown),), {"gain": gain, "zero": zero})

    return make


def _effects() -> Iterator[Effect]:
    for signal, name in NAMES.items():
        yield Effect(f"unit-{name}", f"{signal} in another unit", "sensor", 1.0, 1.0,
                     _unit(signal), kinds=DOSING, whole=True)  # fmt: skip
        yield Effect(f"swapped-{name}", f"{signal} of two pumps swapped", "sensor", 1.0, 1.0,
                     _swapped(signal), kinds=DOSING, whole=True)  # fmt: skip
        yield Effect(f"late-{name}", f"{signal} recorded late", "sensor", 2.0, 60.0,
                     _late(signal), kinds=DOSING)  # fmt: skip
    yield Effect("turned-dp", "dp with exchanged taps", "sensor", 1.0, 1.0, turned, kinds=DOSING,
                 whole=True)  # fmt: skip
    for signal in ZERO:
        yield Effect(f"misadjusted-{NAMES[signal]}", f"{signal} with wrong zero and gain", "sensor",
                     2e-3, 0.4, _misadjusted(signal), kinds=DOSING)  # fmt: skip


EFFECTS = tuple(_effects())
