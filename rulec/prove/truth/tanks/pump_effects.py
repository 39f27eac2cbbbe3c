"""Effects of a pump by its voltage: what it lifts against, the shape of its curve, its ageing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .effect import Built, Effect, Scene, Values, quantile
from .feed import Curve, Feed, Kink, Warming
from .plant import Plant

Random = np.random.Generator


def _with(plant: Plant, feed: Feed, values: Values) -> Built:
    return Built(replace(plant, feed=feed), values)


def held(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The pump feeds below the surface; `size` is the share of the flow lost at the usual level."""
    share = size / quantile(scene.levels(scene.setup.layout.tanks[0]), 0.5)
    return _with(plant, replace(plant.feed, held=share), {"share": (share, "1/cm")})


def lift(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A part of the head holds a height; `size` is its share at the usual voltage."""
    part = size * quantile(scene.setup.shown, 0.5) ** 2
    return _with(plant, replace(plant.feed, lift=part), {"height": (part, "V2")})


def lift_level(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A part of the head holds the level; `size` is its share at usual voltage and level."""
    usual = quantile(scene.levels(scene.setup.layout.tanks[0]), 0.5)
    part = size * quantile(scene.setup.shown, 0.5) ** 2 / usual
    return _with(plant, replace(plant.feed, lift_level=part), {"height": (part, "V2/cm")})


def roll_off(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The flow levels off; `size` is what is missing over what is left at the highest voltage."""
    per_volt = size / float(scene.setup.shown.max())
    return _with(plant, replace(plant.feed, roll=per_volt), {"bend": (per_volt, "1/V")})


def upturn(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """Above a voltage the flow rises more steeply, by the share `size`."""
    voltage = quantile(scene.setup.shown, float(random.uniform(0.25, 0.6)))
    values = {"voltage": (voltage, "V"), "steeper": (size, "1")}
    return _with(plant, replace(plant.feed, kink=Kink(voltage, size)), values)


def exponent(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The flow follows a power of the voltage."""
    own = size * float(random.choice([-0.6, 1.0]))
    curve = Curve(own, quantile(scene.setup.shown, 0.5))
    return _with(plant, replace(plant.feed, curve=curve), {"exponent": (own, "1")})


def decline(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The pump wears; `size` is the share over the record."""
    growth = size / float(np.ptp(scene.course.time))
    return _with(plant, replace(plant.feed, decline=growth), {"growth": (growth, "1/s")})


def warm_up(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The cold pump delivers more, or less, by the share `size`."""
    share = size * float(random.choice([-0.6, 1.0]))
    constant = float(random.uniform(0.1, 0.35)) * float(np.ptp(scene.course.time))
    values = {"share": (share, "1"), "time constant": (constant, "s")}
    return _with(plant, replace(plant.feed, warming=Warming(share, constant)), values)


PUMP_EFFECTS = (
    Effect("held", "level holds the pump back", "physics", "feed", 0.02, 0.8, held),
    Effect("lift", "pump lifts to a height", "physics", "feed", 0.005, 0.8, lift),
    Effect("lift-level", "pump lifts against the level", "physics", "feed", 0.01, 0.9, lift_level),
    Effect("roll-off", "flow levels off", "physics", "feed", 0.02, 4.0, roll_off),
    Effect("upturn", "second, steeper slope", "physics", "feed", 0.02, 2.0, upturn),
    Effect("exponent", "flow by a power", "physics", "feed", 0.02, 0.8, exponent),
    Effect("decline", "flow declines", "physics", "feed", 0.01, 1.0, decline),
    Effect("warm-up", "flow until warm", "physics", "feed", 0.02, 0.8, warm_up),
)
