"""What an effect of a stationary plant is, and where it can be."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..units import Array
from .scene import Scene
from .term import Change

Sort = Literal["physics", "fault", "sensor", "unnamed"]


@dataclass(frozen=True)
class Made:
    """An effect of some size: its terms, its parameters as its key knows them, places in other
    modules where it is, too, and its size."""

    changes: tuple[Change, ...]
    parameters: Mapping[str, float]
    elsewhere: tuple[str, ...] = ()
    size: float = math.nan


Make = Callable[[Scene, str, float, np.random.Generator], Made]
"""Scene, module, size, random numbers that shape the effect -> the effect."""


@dataclass(frozen=True)
class Effect:
    """A kind of effect.

    Attributes
    ----------
    at : `pump` for a pump module, `mixer` for a mixer
    kinds : of pumps that can have it; empty for all but valves
    low, high : of the size; what an effect changes rises with its size
    driver : signal that drives it and may be missing in a recording
    corner : does it act in a part of the operating range only?
    timed : does it follow the time since the recording began?
    slow : does it take days to weeks? Then samples are minutes to an hour apart
    whole : is it there as it is or not at all, without a size?
    """

    name: str
    title: str
    sort: Sort
    low: float
    high: float
    make: Make
    at: Literal["pump", "mixer"] = "pump"
    kinds: tuple[str, ...] = ()
    driver: str = ""
    corner: bool = False
    timed: bool = False
    slow: bool = False
    whole: bool = False


DISPLACEMENT = ("cavity", "membrane", "oil-set")
DOSING = ("cavity", "membrane", "centrifugal")


def warmer(scene: Scene, module: str) -> Array:
    """Temperature of the liquid above its middle, K; that of the first pump for a mixer."""
    values = scene.temperature.get(module)
    if values is None:
        values = next(iter(scene.temperature.values()))
    return np.asarray(values - middle(scene, values))


def middle(scene: Scene, values: Array) -> float:
    """Median as plain number; what shapes an effect is what was recorded first."""
    return float(np.median(values[scene.known]))


def quantile(scene: Scene, values: Array, share: float) -> float:
    """A quantile as plain number."""
    return float(np.quantile(values[scene.known], share))


def span(scene: Scene, values: Array) -> float:
    """Largest less smallest value as plain number."""
    return float(np.ptp(values[scene.known]))
