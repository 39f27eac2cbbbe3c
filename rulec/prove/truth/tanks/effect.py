"""What an effect is: a name, a size that is sought, and how it is built into a plant."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..units import Array
from .balance import Course
from .build import Setup
from .plant import LevelSensor, Plant, Tank

Values = Mapping[str, tuple[float, str]]
"""True parameters of an effect by name, each with its unit."""

Sort = Literal["physics", "sensor", "fault", "unnamed"]
Part = Literal["tank", "feed", "sensor"]


@dataclass(frozen=True)
class Scene:
    """A plant without effects and what happens in it: effects are placed by what they will see."""

    setup: Setup
    course: Course

    def levels(self, tank: str) -> Array:
        """Levels of a tank, cm."""
        return self.course.levels[:, self.setup.layout.tanks.index(tank)]

    def falling(self, tank: str) -> Array:
        """What falls into a tank, cm3/s."""
        return self.course.fallen[:, self.setup.layout.tanks.index(tank)]

    def below(self, tank: str) -> str | None:
        """The tank below another one; none below the last."""
        names = self.setup.layout.tanks
        number = names.index(tank) + 1
        return names[number] if number < len(names) else None

    def time_at(self, share: float) -> float:
        """The time after a share of the record, s."""
        return round(float(self.course.time[0] + share * np.ptp(self.course.time)), 1)


@dataclass(frozen=True)
class Built:
    """A plant with one more effect."""

    plant: Plant
    values: Values


@dataclass(frozen=True)
class Here:
    """Where an effect is built, and how large it is made.

    `plant` has the effects that were built before, `place` is a tank (of a sensor: its tank) or the
    feed, and `random` shapes the effect.
    """

    scene: Scene
    plant: Plant
    at: Part
    place: str
    size: float
    random: np.random.Generator

    @property
    def tank(self) -> Tank:
        """The tank here."""
        return self.plant.tank(self.place)

    @property
    def sensor(self) -> LevelSensor:
        """The sensor here."""
        return self.plant.sensor(self.place)

    @property
    def usual_fall(self) -> float:
        """Median of what falls in here, cm3/s."""
        return quantile(self.scene.falling(self.place), 0.5)

    @property
    def usual_input(self) -> float:
        """Median of the input."""
        return quantile(self.scene.setup.shown, 0.5)

    @property
    def usual_first(self) -> float:
        """Median level of the first tank, cm."""
        return quantile(self.scene.levels(self.scene.setup.layout.tanks[0]), 0.5)

    @property
    def record(self) -> float:
        """Length of the record, s."""
        return float(np.ptp(self.scene.course.time))

    def level(self, share: float) -> float:
        """A quantile of the level here, cm."""
        return quantile(self.scene.levels(self.place), share)

    def voltage(self, share: float) -> float:
        """A quantile of the reading here, V."""
        return round(quantile(self.sensor.gain * self.scene.levels(self.place), share), 2)

    def between(self, low: float, high: float) -> float:
        """A draw."""
        return float(self.random.uniform(low, high))

    def changed(self, values: Values, **numbers: Any) -> Built:
        """The plant with other numbers of the tank, feed or sensor here."""
        match self.at:
            case "tank":
                plant = self.plant.with_tank(replace(self.tank, **numbers))
            case "feed":
                plant = replace(self.plant, feed=replace(self.plant.feed, **numbers))
            case "sensor":
                plant = self.plant.with_sensor(replace(self.sensor, **numbers))
        return Built(plant, values)


Make = Callable[[Here], Built]


def number(
    field: str, parameter: str, unit: str, of: Callable[[Here], float] = lambda here: here.size
) -> Make:
    """An effect that is one number of its tank, feed or sensor; as it is the size, if not told."""

    def make(here: Here) -> Built:
        value = of(here)
        return here.changed({parameter: (value, unit)}, **{field: value})

    return make


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
    at: Part
    low: float
    high: float
    make: Make
    scale: float = 1.0


def quantile(values: Array, share: float) -> float:
    """A quantile as plain number."""
    return float(np.quantile(values, share))
