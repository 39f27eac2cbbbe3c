"""Effects that no catalogue names; the answer to them is their place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .effect import Built, Effect, Scene, quantile
from .feed import Bypass
from .plant import Plant, Vortex

Random = np.random.Generator


def vortex(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """An air core narrows the outlet above a flow, and the outflow surges."""
    flow = quantile(scene.falling(place), random.uniform(0.35, 0.6))
    core = Vortex(flow, size, float(random.uniform(30.0, 90.0)))
    values = {
        "flow": (flow, "cm3/s"),
        "share": (size, "1"),
        "period": (core.period, "s"),
    }
    return Built(plant.with_tank(replace(plant.tank(place), vortex=core)), values)


def bypass(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A strong jet of the feed partly misses the first tank."""
    falling = scene.falling(scene.setup.layout.tanks[0])
    # A feed that is off for long would let the jet begin with no flow.
    flow = max(quantile(falling, random.uniform(0.1, 0.4)), 0.1 * float(falling.max()))
    feed = replace(plant.feed, bypass=Bypass(flow, size))
    return Built(replace(plant, feed=feed), {"flow": (flow, "cm3/s"), "share": (size, "1")})


def jet(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """What falls in hits the pressure cell, with the square of its flow; `size` V at usual flow."""
    strength = size / quantile(scene.falling(place), 0.5) ** 2
    sensor = replace(plant.sensor(place), jet=strength)
    return Built(plant.with_sensor(sensor), {"strength": (strength, "V/(cm3/s)**2")})


UNNAMED_EFFECTS = (
    Effect("vortex", "air core, outflow surges", "unnamed", "tank", 0.02, 0.6, vortex),
    Effect("bypass", "jet misses the first tank", "unnamed", "feed", 0.05, 1.0, bypass),
    Effect("jet", "jet hits the pressure cell", "unnamed", "sensor", 0.05, 1.4, jet),
)
