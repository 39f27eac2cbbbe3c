"""Effects of a stationary plant: their form, and the place and size of one that is made."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..units import Array
from .scene import Scene
from .term import Change, Kind, Law, Reading, Term

MINUTE = 60.0

Sort = Literal["physics", "fault", "sensor", "unnamed"]


@dataclass(frozen=True)
class Made:
    """An effect of some size: its terms, its parameters by their names in the key, its places in
    other modules, and its size."""

    changes: tuple[Change, ...]
    parameters: Mapping[str, float]
    elsewhere: tuple[str, ...] = ()
    size: float = math.nan


@dataclass(frozen=True)
class Here:
    """Place and size of an effect; `random` draws its shape."""

    scene: Scene
    module: str
    size: float
    random: np.random.Generator

    def plain(self, signal: str) -> Array:
        """Return the true values of a signal of the module without effects, SI."""
        return self.scene.plain[f"{self.module}.{signal}"]

    def value(self, parameter: str) -> float:
        """Return a true parameter of the module, SI."""
        return self.scene.values[f"{self.module}.{parameter}"]

    def usual(self, signal: str) -> float:
        """Return the median of a signal."""
        return middle(self.scene, self.plain(signal))

    def limit(self, signal: str, low: float, high: float) -> float:
        """Return a quantile of a signal, at a drawn share."""
        return quantile(self.scene, self.plain(signal), self.between(low, high))

    def between(self, low: float, high: float) -> float:
        """Draw uniformly."""
        return float(self.random.uniform(low, high))

    def signed(self, down: float = -1.0) -> float:
        """Draw the size, or `down` times it."""
        return self.size * float(self.random.choice([down, 1.0]))

    @property
    def warmer(self) -> Array:
        """Temperature of the liquid above its median, K; for a mixer, at the first pump."""
        values = self.scene.temperature.get(self.module)
        if values is None:
            values = next(iter(self.scene.temperature.values()))
        return np.asarray(values - middle(self.scene, values))

    @property
    def grown(self) -> Array:
        """Linear growth to the size at the end of the recording."""
        return self.size * self.scene.time / self.scene.length

    @property
    def per_day(self) -> float:
        """Growth of the size per day."""
        return self.size / self.scene.days

    def dying(self) -> tuple[Array, float]:
        """Return an exponential decay from 1, and its time constant, min."""
        constant = self.between(0.12, 0.4) * self.scene.length
        return np.exp(-self.scene.time / constant), constant * self.scene.pace / MINUTE

    def term(self, kind: Kind, law: Law, **parameters: float) -> Made:
        """Return the effect as a term in the module's laws."""
        return Made((Term(kind, self.module, law),), parameters)

    def constant(self, kind: Kind, course: Array, **parameters: float) -> Made:
        """Return the same if the term does not depend on the operating point."""
        return self.term(kind, lambda s: course, **parameters)

    def reading(self, signal: str, shown: Callable[[Array], Array], **parameters: float) -> Made:
        """Return the effect as an error of a sensor."""
        return Made((Reading(f"{self.module}.{signal}", shown),), parameters)


Make = Callable[[Here], Made]


@dataclass(frozen=True)
class Effect:
    """A kind of effect.

    Attributes
    ----------
    at : `pump` for a pump module, `mixer` for a mixer
    kinds : of pumps that can have it; empty for all but valves
    low, high : of the size; the change by an effect rises with its size
    driver : signal that drives it and may be missing in a recording
    corner : whether it acts in a part of the operating range only
    timed : whether it follows the time since the recording began
    slow : whether it takes days to weeks; then samples are minutes to an hour apart
    whole : whether it has no size
    """

    name: str
    title: str
    low: float
    high: float
    make: Make
    sort: Sort = "physics"
    at: Literal["pump", "mixer"] = "pump"
    kinds: tuple[str, ...] = ()
    driver: str = ""
    corner: bool = False
    timed: bool = False
    slow: bool = False
    whole: bool = False


STROKES = ("cavity", "membrane")
DISPLACEMENT = (*STROKES, "oil-set")
DOSING = (*STROKES, "centrifugal")


def middle(scene: Scene, values: Array) -> float:
    """Return the median of the first recording, which shapes an effect."""
    return float(np.median(values[scene.known]))


def quantile(scene: Scene, values: Array, share: float) -> float:
    """Return a quantile of the first recording."""
    return float(np.quantile(values[scene.known], share))


def span(scene: Scene, values: Array) -> float:
    """Return the range of values of the first recording."""
    return float(np.ptp(values[scene.known]))
