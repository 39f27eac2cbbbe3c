"""Effects of tanks: their name, their size, and how they are built into a plant."""

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
    """A plant without effects and its course, which sets the limits of effects."""

    setup: Setup
    course: Course

    def levels(self, tank: str) -> Array:
        """Return the levels of a tank, cm."""
        return self.course.levels[:, self.setup.layout.tanks.index(tank)]

    def falling(self, tank: str) -> Array:
        """Return the inflow of a tank, cm3/s."""
        return self.course.fallen[:, self.setup.layout.tanks.index(tank)]

    def below(self, tank: str) -> str | None:
        """Return the tank below another one; None for the last."""
        names = self.setup.layout.tanks
        number = names.index(tank) + 1
        return names[number] if number < len(names) else None

    def time_at(self, share: float) -> float:
        """Return the time after a share of the recording, s."""
        return round(float(self.course.time[0] + share * np.ptp(self.course.time)), 1)


@dataclass(frozen=True)
class Built:
    """A plant with one more effect."""

    plant: Plant
    values: Values


@dataclass(frozen=True)
class Here:
    """Place and size of an effect.

    `plant` has the effects that were built before, `place` is a tank (of a sensor: its tank) or the
    feed, and `random` draws the shape of the effect.
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
        """Median inflow of this tank, cm3/s."""
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
        """Length of the recording, s."""
        return float(np.ptp(self.scene.course.time))

    def level(self, share: float) -> float:
        """Return a quantile of the level here, cm."""
        return quantile(self.scene.levels(self.place), share)

    def voltage(self, share: float) -> float:
        """Return a quantile of the reading here, V."""
        return round(quantile(self.sensor.gain * self.scene.levels(self.place), share), 2)

    def between(self, low: float, high: float) -> float:
        """Draw uniformly."""
        return float(self.random.uniform(low, high))

    def changed(self, values: Values, **numbers: Any) -> Built:
        """Return the plant with other numbers of the tank, feed or sensor here."""
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
    """Return an effect that is one number of its tank, feed or sensor, by default its size."""

    def make(here: Here) -> Built:
        value = of(here)
        return here.changed({parameter: (value, unit)}, **{field: value})

    return make


@dataclass(frozen=True)
class Effect:
    """A kind of effect.

    Attributes
    ----------
    at : the part it belongs to
    low, high : of the size; the change by an effect rises with its size
    scale : of the target change, for effects that would otherwise be unrealistic
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
    """Return a quantile."""
    return float(np.quantile(values, share))
