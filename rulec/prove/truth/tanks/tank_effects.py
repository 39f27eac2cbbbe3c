"""Effects of tanks: what runs over, other outlets, losses, shapes, and faults that begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .effect import Built, Effect, Scene, quantile
from .laws import BROAD, GRAVITY, SHARP
from .plant import Body, Fault, Plant, Power, Rim

Random = np.random.Generator


def overflow_sharp(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A round rim takes any flow within millimetres; `size` is how often the tank would be full."""
    height = quantile(scene.levels(place), 1.0 - size)
    return _with_rim(scene, plant, place, height, SHARP * random.uniform(8.0, 16.0), random)


def overflow_broad(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A notch of `size` cm in the wall; the level goes on rising."""
    height = quantile(scene.levels(place), random.uniform(0.3, 0.6))
    return _with_rim(scene, plant, place, height, BROAD * size, random)


def _with_rim(
    scene: Scene, plant: Plant, place: str, height: float, strength: float, random: Random
) -> Built:
    caught = float(random.uniform(0.15, 0.75)) if scene.below(place) else 0.0
    rim = Rim(height, strength, caught)
    values = {
        "height": (height, "cm"),
        "strength": (strength, "cm**1.5/s"),
        "caught": (caught, "1"),
    }
    return Built(plant.with_tank(replace(plant.tank(place), rim=rim)), values)


def laminar(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A narrow outlet: the head has a part linear in the flow, `size` times the other at work."""
    tank = plant.tank(place)
    flow = quantile(scene.falling(place), 0.5)
    resistance = size * 0.5 * flow / (GRAVITY * tank.outlet**2)
    return Built(
        plant.with_tank(replace(tank, laminar=resistance)), {"laminar": (resistance, "s/cm2")}
    )


def _power(scene: Scene, plant: Plant, place: str, exponent: float) -> Built:
    level = quantile(scene.levels(place), 0.5)
    tank = replace(plant.tank(place), power=Power(exponent, level))
    return Built(plant.with_tank(tank), {"exponent": (exponent, "1"), "level": (level, "cm")})


def power_high(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The outlet follows the level with more than the power 0.5."""
    return _power(scene, plant, place, 0.5 + size)


def power_low(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The outlet follows the level with less than the power 0.5: it chokes."""
    return _power(scene, plant, place, 0.5 - size)


def outlet_height(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The outlet lies above the floor that the sensor counts from."""
    return Built(plant.with_tank(replace(plant.tank(place), height=size)), {"height": (size, "cm")})


def seepage(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A constant flow is lost, `size` times the usual one."""
    flow = size * quantile(scene.falling(place), 0.5)
    return Built(
        plant.with_tank(replace(plant.tank(place), seepage=flow)), {"flow": (flow, "cm3/s")}
    )


def evaporation(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The same flow is lost from every tank, whatever its level; the place is the first one's."""
    flow = size * quantile(scene.falling(place), 0.5)
    for tank in plant.tanks:
        plant = plant.with_tank(replace(tank, seepage=tank.seepage + flow))
    return Built(plant, {"flow of each tank": (flow, "cm3/s")})


def growing_area(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """Walls lean outwards; `size` is the area gained per cm as share of the floor."""
    tank = plant.tank(place)
    growth = size * tank.area
    return Built(plant.with_tank(replace(tank, growth=growth)), {"growth": (growth, "cm2/cm")})


def body(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """Something stands in the tank, `size` of its floor."""
    tank = plant.tank(place)
    inside = Body(size * tank.area, quantile(scene.levels(place), random.uniform(0.5, 0.75)))
    values = {"area": (inside.area, "cm2"), "height": (inside.height, "cm")}
    return Built(plant.with_tank(replace(tank, body=inside)), values)


def leak(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """From some time on an orifice to the outside, `size` of the outlet."""
    tank, begin = plant.tank(place), scene.time_at(random.uniform(0.35, 0.65))
    fault = Fault(size * tank.outlet, begin)
    values = {"area": (fault.size, "cm2"), "begin": (begin, "s")}
    return Built(plant.with_tank(replace(tank, leak=fault)), values)


def clogging(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """From some time on a part of the outlet is closed."""
    tank, begin = plant.tank(place), scene.time_at(random.uniform(0.35, 0.65))
    values = {"share": (size, "1"), "begin": (begin, "s")}
    clogged = replace(tank, clog=Fault(size, begin))
    return Built(plant.with_tank(clogged), values)


TANK_EFFECTS = (
    Effect("overflow-sharp", "round rim", "physics", "tank", 0.02, 0.8, overflow_sharp),
    Effect("overflow-broad", "notch in the rim", "physics", "tank", 0.01, 8.0, overflow_broad),
    Effect("laminar", "outlet with laminar part", "physics", "tank", 0.02, 6.0, laminar),
    Effect("power-high", "outlet with high exponent", "physics", "tank", 0.02, 0.6, power_high),
    Effect("power-low", "outlet with low exponent", "physics", "tank", 0.02, 0.4, power_low),
    Effect("outlet-height", "outlet above the floor", "physics", "tank", 0.2, 3.0, outlet_height),
    Effect("seepage", "constant seepage", "physics", "tank", 0.005, 0.5, seepage),
    Effect("evaporation", "constant loss of each tank", "physics", "tank", 0.003, 0.3, evaporation),
    Effect("growing-area", "walls lean outwards", "physics", "tank", 0.005, 0.6, growing_area),
    Effect("body", "something stands in the tank", "physics", "tank", 0.05, 0.85, body),
    Effect("leak", "leak that begins", "fault", "tank", 0.01, 1.0, leak),
    Effect("clogging", "outlet clogs at once", "fault", "tank", 0.02, 0.8, clogging),
)
