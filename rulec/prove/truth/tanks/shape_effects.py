"""Effects of how tanks are built and joined: shapes, openings, pipes between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .effect import Built, Effect, Scene, quantile
from .plant import Opening, Plant

Random = np.random.Generator


def drowned(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The pipe of the outlet ends below the level of the next tank, which holds its flow back."""
    below = scene.below(place)
    assert below is not None
    height = (1.0 - size) * float(scene.levels(below).max())
    tank = replace(plant.tank(place), drowned=height)
    return Built(plant.with_tank(tank), {"end of the pipe": (height, "cm")})


def link(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A second pipe joins two tanks at their floors, `size` of the outlet."""
    tank = plant.tank(place)
    area = size * tank.outlet
    return Built(plant.with_tank(replace(tank, link=area)), {"area": (area, "cm2")})


def drain(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A cock at the floor stands open, `size` of the outlet."""
    tank = plant.tank(place)
    area = size * tank.outlet
    return Built(plant.with_tank(replace(tank, drain=area)), {"area": (area, "cm2")})


def side(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """An opening in the wall, `size` of the outlet."""
    tank = plant.tank(place)
    height = quantile(scene.levels(place), random.uniform(0.2, 0.6))
    hole = Opening(size * tank.outlet, height)
    values = {"area": (hole.area, "cm2"), "height": (height, "cm")}
    return Built(plant.with_tank(replace(tank, side=hole)), values)


def cone(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A funnel; `size` is the width gained per cm as share of that at the floor."""
    tank = replace(plant.tank(place), cone=size)
    return Built(plant.with_tank(tank), {"widening": (size, "1/cm")})


def lying(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A lying cylinder as wide as the plain tank in its middle; `size` is how full it gets."""
    diameter = float(scene.levels(place).max()) / size
    tank = replace(plant.tank(place), lying=diameter)
    return Built(plant.with_tank(tank), {"diameter": (diameter, "cm")})


def closing(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The outlet fouls; `size` is the growth of its resistance over the record."""
    growth = size / float(np.ptp(scene.course.time))
    tank = replace(plant.tank(place), closing=growth)
    return Built(plant.with_tank(tank), {"growth": (growth, "1/s")})


SHAPE_EFFECTS = (
    Effect("drowned", "outlet drowns in the next tank", "physics", "tank", 0.05, 1.0, drowned),
    Effect("link", "second pipe to the next tank", "physics", "tank", 0.01, 2.0, link),
    Effect("drain", "cock at the floor is open", "physics", "tank", 0.01, 1.0, drain),
    Effect("side", "opening in the wall", "physics", "tank", 0.02, 3.0, side),
    Effect("cone", "funnel", "physics", "tank", 0.003, 0.3, cone),
    Effect("lying", "lying cylinder", "physics", "tank", 0.3, 0.98, lying),
    Effect("closing", "outlet fouls", "physics", "tank", 0.01, 1.5, closing),
)
