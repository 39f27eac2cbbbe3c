"""Mistakes of wiring and files: they hold in all samples, and no physics is missing in the
model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..transients import late
from ..units import BAR
from .effect import DOSING, Effect, Here, Made, Make
from .solve import Stalled
from .term import Column

UNITS: Mapping[str, tuple[float, ...]] = {
    "dp": (14.5038, 100.0, 0.1),  # psi, kPa and MPa as bar
    "P_el": (1e-3, 1.0 / 745.7),  # kW and hp as W
    "n": (1.0 / 60.0, 2.0 * np.pi / 60.0),  # rev/s and rad/s as rpm
}
"""Factors of a column in another unit than in its header, by signal."""

NAMES = {"dp": "dp", "P_el": "power", "n": "speed"}
"""Names of signals in those of effects."""

ZERO = {"dp": 0.3 * BAR, "P_el": 60.0}
"""Offset of a misadjusted meter per relative error of its gain, SI."""


def _unit(signal: str) -> Make:
    def make(here: Here) -> Made:
        factor = float(here.random.choice(UNITS[signal]))
        place = f"{here.module}.{signal}"
        return Made((Column(place, lambda c: c[place] * factor),), {"factor": factor})

    return make


def turned(here: Here) -> Made:
    """The taps of a pressure difference are exchanged."""
    place = f"{here.module}.dp"
    return Made((Column(place, lambda c: -c[place]),), {})


def _swapped(signal: str) -> Make:
    """The columns of two pumps are exchanged."""

    def make(here: Here) -> Made:
        others = [m for m in here.scene.rig.pumps if m != here.module]
        if not others:
            raise Stalled("no other pump whose column could be taken")
        one, other = f"{here.module}.{signal}", f"{here.random.choice(others)}.{signal}"
        changes = Column(one, lambda c: c[other]), Column(other, lambda c: c[one])
        return Made(changes, {}, (other,))

    return make


def _late(signal: str) -> Make:
    """A column comes from a recorder whose clock is late by `size` samples."""

    def make(here: Here) -> Made:
        by, place = max(round(here.size), 1), f"{here.module}.{signal}"
        shift = by * here.scene.pace
        return Made((Column(place, lambda c: late(c[place], by)),), {"shift": shift})

    return make


def _misadjusted(signal: str) -> Make:
    """A meter has a wrong zero and a wrong gain."""

    def make(here: Here) -> Made:
        gain, zero = here.signed(), here.signed()
        return here.reading(
            signal, lambda v: v * (1.0 + gain) + zero * ZERO[signal], gain=gain, zero=zero
        )

    return make


EFFECTS = (
    *(
        effect
        for signal, name in NAMES.items()
        for effect in (
            Effect(f"unit-{name}", f"{signal} in another unit", 1.0, 1.0, _unit(signal), "sensor",
                   kinds=DOSING, whole=True),
            Effect(f"swapped-{name}", f"{signal} of two pumps swapped", 1.0, 1.0,
                   _swapped(signal), "sensor", kinds=DOSING, whole=True),
            Effect(f"late-{name}", f"{signal} recorded late", 2.0, 60.0, _late(signal), "sensor",
                   kinds=DOSING),
        )
    ),
    Effect("turned-dp", "dp with exchanged taps", 1.0, 1.0, turned, "sensor", kinds=DOSING,
           whole=True),
    *(
        Effect(f"misadjusted-{NAMES[signal]}", f"{signal} with wrong zero and gain", 2e-3, 0.4,
               _misadjusted(signal), "sensor", kinds=DOSING)
        for signal in ZERO
    ),
)  # fmt: skip
