"""Effects of tanks, from `effects.yaml`: their place and size, and how they are built into a plant.

Ids of a case are such as `upper.leak` and `lower.y.lag`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..formulas import Names
from ..units import Array
from .build import Layout, Setup
from .feed import Bypass, Curve, Kink, Warming
from .laws import BROAD, GRAVITY, SHARP
from .plant import Body, Fault, Opening, Plant, Power, Rim, Vortex

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
    feed, and `random` draws the shape of the effect. All attributes are names in the formulas,
    beside `known`.
    """

    setup: Setup
    plant: Plant
    place: str
    size: float
    random: np.random.Generator
    quantile = staticmethod(quantile)

    def time_at(self, share: float) -> float:
        """Return the time after a share of the recording, s."""
        time = self.setup.course.time
        return round(float(time[0] + share * np.ptp(time)), 1)

    def level(self, share: float) -> float:
        """Return a quantile of the level here, cm."""
        return quantile(self.setup.levels(self.place), share)

    def voltage_at(self, share: float) -> float:
        """Return a quantile of the reading here, V."""
        gain = self.plant.sensor(self.place).gain
        return round(quantile(gain * self.setup.levels(self.place), share), 2)

    def between(self, low: float, high: float) -> float:
        """Draw uniformly."""
        return float(self.random.uniform(low, high))

    def signed(self, down: float) -> float:
        """Draw the size, or `down` times it."""
        return self.size * float(self.random.choice([down, 1.0]))


def known(here: Here) -> Mapping[str, Any]:
    """Return numbers and courses that formulas may use, beside the attributes of `here`.

    `falls` is the inflow of this tank, `first_falls` that of the first, cm3/s; `shown` the recorded
    input; `record` the length of the recording, s; `below` the tank below.
    """
    setup, place, shown = here.setup, here.place, here.setup.shown
    tanks = setup.layout.tanks
    names = {**CONSTANTS, "fed": setup.course.fed, "shown": shown}
    names["record"] = float(np.ptp(setup.course.time))
    first = tanks[0]
    names["usual_input"], names["highest_input"] = quantile(shown, 0.5), float(shown.max())
    names["usual_first"] = quantile(setup.levels(first), 0.5)
    names["first_falls"] = setup.falling(first)
    names["highest_fall"] = float(names["first_falls"].max())
    if place in tanks:
        names["tank"], names["below"] = here.plant.tank(place), dict(pairwise(tanks)).get(place)
        names["highest"], names["falls"] = float(setup.levels(place).max()), setup.falling(place)
        names["usual_fall"] = quantile(names["falls"], 0.5)
        if names["below"]:
            names["highest_below"] = float(setup.levels(names["below"]).max())
    return names


def made(effect: Effect, here: Here) -> Built:
    """Build an effect into the plant."""
    stated, names = effect.stated, Names(here, known(here), size=here.size)
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
            plant = plant.with_tank(replace(plant.tank(here.place), **numbers))
    for tank in plant.tanks if added else ():
        more = {field: getattr(tank, field) + value for field, value in added.items()}
        plant = plant.with_tank(replace(tank, **more))
    return Built(plant, {**names, **numbers, **added})


SENSOR = ".y"
"""Suffix of a sensor after the name of its tank."""


@dataclass(frozen=True)
class Placed:
    """An effect and its place: a tank, the feed, or a sensor by its tank."""

    effect: Effect
    place: str

    @property
    def module(self) -> str:
        """The place in a plant file: a module, or a signal."""
        return f"{self.place}{SENSOR}" if self.effect.at == "sensor" else self.place

    @property
    def id(self) -> str:
        """Such as `lower.y.clipping`."""
        return f"{self.module}.{self.effect.name}"


def facts(layout: Layout, place: str) -> dict[str, Any]:
    """Return what formulas may ask of a place in a plant.

    The datum of a level that is not `measured` is arbitrary; a flow meter already measures what a
    pump does with its `voltage`.
    """
    return {
        "first": place == layout.tanks[0],
        "last": place == layout.tanks[-1],
        "measured": place in layout.measured,
        "one_sensor": len(layout.measured) == 1,
        "voltage": not layout.metered,
    }


def possible_effects(layout: Layout) -> dict[str, Placed]:
    """Return every effect at every place of a plant where it can show, by id."""
    places = {"tank": layout.tanks, "feed": (layout.feed,), "sensor": layout.measured}
    every = [Placed(effect, place) for effect in EFFECTS for place in places[effect.at]]
    shows = (
        Names(None, facts(layout, p.place)).of(p.effect.stated.get("where", "1")) for p in every
    )
    return {p.id: p for p, shown in zip(every, shows, strict=True) if shown}


def _effect(key: str, stated: Mapping[str, Any]) -> Effect:
    """A key such as `y.lag` is of a sensor."""
    name, (low, high) = key.removeprefix("y."), map(float, stated["size"])
    at = "sensor" if name != key else stated.get("at", "tank")
    sort = stated.get("sort", "sensor" if at == "sensor" else "physics")
    return Effect(name, stated["title"], sort, at, low, high, stated.get("scale", 1.0), stated)


FILE = Path(__file__).with_name("effects.yaml")
EFFECTS = tuple(
    _effect(key, stated) for key, stated in yaml.safe_load(FILE.read_text(encoding="utf-8")).items()
)
