"""Mistakes in the plant file: the connections of the plant differ from the file.

They hold in all samples, and no physics is missing in the model: the true plant obeys the plain
laws of a network that nobody wrote down.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from .rig import Rig
from .solve import Stalled


def moved(rig: Rig, random: np.random.Generator) -> tuple[Rig, Rig, str]:
    """A pump feeds another mixer than stated."""
    if len(rig.mixers) < 2:
        raise Stalled("no other mixer to be fed")
    module = str(random.choice(list(rig.pumps)))
    others = [m for m in rig.mixers if m != rig.downstream[module]]
    return rig, _led(rig, module, str(random.choice(others))), module


def missing(rig: Rig, random: np.random.Generator) -> tuple[Rig, Rig, str]:
    """A pipe is not stated; each mixer is still fed according to the file."""
    module = _spared(rig, random)
    return rig, _led(rig, module, None), module


def not_there(rig: Rig, random: np.random.Generator) -> tuple[Rig, Rig, str]:
    """A pump is stated to feed a mixer, but feeds none; each mixer is still fed."""
    module = _spared(rig, random)
    return _led(rig, module, None), rig, module


WAYS: Mapping[str, Callable[[Rig, np.random.Generator], tuple[Rig, Rig, str]]] = {
    "connection-moved": moved,
    "connection-missing": missing,
    "connection-not-there": not_there,
}
"""By name: the true plant, the stated one, and the module whose outlet leads elsewhere."""


def _spared(rig: Rig, random: np.random.Generator) -> str:
    fed = list(rig.downstream.values())
    found = [m for m, to in rig.downstream.items() if to is not None and fed.count(to) > 1]
    if not found:
        raise Stalled("every mixer is fed by one module alone")
    return str(random.choice(found))


def _led(rig: Rig, module: str, to: str | None) -> Rig:
    return replace(rig, downstream={**rig.downstream, module: to})
