"""Effects of tanks: their name, their size, and how they are built into a plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..formulas import Names
from ..units import Array
from .balance import Course
from .build import Setup
from .feed import Bypass, Curve, Kink, Warming
from .laws import BROAD, GRAVITY, SHARP
from .plant import Body, Fault, Opening, Plant, Power, Rim, Tank, Vortex

Values = Mapping[str, Any]
"""Numbers of an effect by name, its size among them."""

CONSTANTS: Mapping[str, Any] = {
    **{part.__name__: part for part in (Body, Fault, Opening, Power, Rim, Vortex)},
    **{part.__name__: part for part in (Bypass, Curve, Kink, Warming)},
    **{"BROAD": BROAD, "GRAVITY": GRAVITY, "SHARP": SHARP},
}
"""Names in the formulas of `effects.yaml` beside the attributes of `Here`."""


def quantile(values: Array, share: float) -> float:
    """Return a quantile."""
    return float(np.quantile(values, share))


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


@dataclass(frozen=True)
class Built:
    """A plant with one more effect."""

    plant: Plant
    values: Values


@dataclass(frozen=True)
class Effect:
    """A kind of effect; see `effects.yaml`.

    Attributes
    ----------
    at : the part it belongs to: `tank`, `feed` or `sensor`
    low, high : of the size; the change by an effect rises with its size
    scale : of the target change, for effects that would otherwise be unrealistic
    """

    name: str
    title: str
    sort: str
    at: str
    low: float
    high: float
    scale: float
    stated: Mapping[str, Any] = field(repr=False, compare=False)


@dataclass(frozen=True)
class Here:
    """Place and size of an effect.

    `plant` has the effects that were built before, `place` is a tank (of a sensor: its tank) or the
    feed, and `random` draws the shape of the effect. All attributes are names in the formulas.
    """

    scene: Scene
    plant: Plant
    place: str
    size: float
    random: np.random.Generator
    quantile = staticmethod(quantile)

    @property
    def tank(self) -> Tank:
        """The tank here."""
        return self.plant.tank(self.place)

    @property
    def below(self) -> str | None:
        """The tank below; None for the last."""
        return self.scene.below(self.place)

    @property
    def highest_below(self) -> float:
        """Highest level of the tank below, cm."""
        return float(self.scene.levels(str(self.below)).max())

    @property
    def highest(self) -> float:
        """Highest level here, cm."""
        return float(self.scene.levels(self.place).max())

    @property
    def falls(self) -> Array:
        """Inflow of this tank, cm3/s."""
        return self.scene.falling(self.place)

    @property
    def first_falls(self) -> Array:
        """Inflow of the first tank, cm3/s."""
        return self.scene.falling(self.scene.setup.layout.tanks[0])

    @property
    def highest_fall(self) -> float:
        """Largest inflow of the first tank, cm3/s."""
        return float(self.first_falls.max())

    @property
    def usual_fall(self) -> float:
        """Median inflow of this tank, cm3/s."""
        return quantile(self.falls, 0.5)

    @property
    def fed(self) -> Array:
        """Flow of the feed, cm3/s."""
        return self.scene.course.fed

    @property
    def shown(self) -> Array:
        """The recorded input."""
        return self.scene.setup.shown

    @property
    def usual_input(self) -> float:
        """Median of the input."""
        return quantile(self.shown, 0.5)

    @property
    def highest_input(self) -> float:
        """Largest input."""
        return float(self.shown.max())

    @property
    def usual_first(self) -> float:
        """Median level of the first tank, cm."""
        return quantile(self.scene.levels(self.scene.setup.layout.tanks[0]), 0.5)

    @property
    def record(self) -> float:
        """Length of the recording, s."""
        return float(np.ptp(self.scene.course.time))

    def time_at(self, share: float) -> float:
        """Return the time after a share of the recording, s."""
        return round(float(self.scene.course.time[0] + share * self.record), 1)

    def level(self, share: float) -> float:
        """Return a quantile of the level here, cm."""
        return quantile(self.scene.levels(self.place), share)

    def voltage_at(self, share: float) -> float:
        """Return a quantile of the reading here, V."""
        gain = self.plant.sensor(self.place).gain
        return round(quantile(gain * self.scene.levels(self.place), share), 2)

    def between(self, low: float, high: float) -> float:
        """Draw uniformly."""
        return float(self.random.uniform(low, high))

    def signed(self, down: float) -> float:
        """Draw the size, or `down` times it."""
        return self.size * float(self.random.choice([down, 1.0]))


def made(effect: Effect, here: Here) -> Built:
    """Build an effect into the plant."""
    stated, names = effect.stated, Names(here, CONSTANTS, size=here.size)
    names.fix(stated.get("fixed", {}))
    numbers = {field: names.of(formula) for field, formula in stated.get("set", {}).items()}
    added = {field: names.of(formula) for field, formula in stated.get("each", {}).items()}
    plant = here.plant
    match effect.at:
        case "feed":
            plant = replace(plant, feed=replace(plant.feed, **numbers))
        case "sensor":
            plant = plant.with_sensor(replace(plant.sensor(here.place), **numbers))
        case _ if numbers:
            plant = plant.with_tank(replace(here.tank, **numbers))
    for tank in plant.tanks if added else ():
        more = {field: getattr(tank, field) + value for field, value in added.items()}
        plant = plant.with_tank(replace(tank, **more))
    return Built(plant, {**names, **numbers, **added})
