"""What an effect is: a name, a size that is sought, and how it is built into a plant."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..units import Array
from .balance import Course
from .build import Setup
from .plant import Plant

Values = Mapping[str, tuple[float, str]]
"""True parameters of an effect by name, each with its unit."""

Sort = Literal["physics", "sensor", "fault", "unnamed"]


@dataclass(frozen=True)
class Scene:
    """A plant without effects and what happens in it: effects are placed by what they will see."""

    setup: Setup
    course: Course

    def levels(self, tank: str) -> Array:
        """Levels of a tank, cm."""
        return self.course.levels[:, self._number(tank)]

    def falling(self, tank: str) -> Array:
        """What falls into a tank, cm3/s."""
        return self.course.fallen[:, self._number(tank)]

    def below(self, tank: str) -> str | None:
        """The tank below another one; none below the last."""
        names = self.setup.layout.tanks
        number = names.index(tank) + 1
        return names[number] if number < len(names) else None

    def time_at(self, share: float) -> float:
        """The time after a share of the record, s."""
        return round(float(self.course.time[0] + share * np.ptp(self.course.time)), 1)

    def _number(self, tank: str) -> int:
        return self.setup.layout.tanks.index(tank)


@dataclass(frozen=True)
class Built:
    """A plant with one more effect."""

    plant: Plant
    values: Values


Make = Callable[[Scene, Plant, str, float, np.random.Generator], Built]
"""Scene, plant so far, place, size, random numbers that shape the effect -> plant with it."""


@dataclass(frozen=True)
class Effect:
    """A kind of effect.

    Attributes
    ----------
    at : what it belongs to: a tank, the feed or a sensor
    low, high : of the size; what an effect changes rises with its size
    scale : of what it should change, for effects that would else be grotesque
    """

    name: str
    title: str
    sort: Sort
    at: Literal["tank", "feed", "sensor"]
    low: float
    high: float
    make: Make
    scale: float = 1.0


def quantile(values: Array, share: float) -> float:
    """A quantile as plain number."""
    return float(np.quantile(values, share))
