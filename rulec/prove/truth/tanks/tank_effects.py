"""Effects of tanks: overflow, other outlets, losses, shapes, pipes between tanks, and faults that
begin."""

from __future__ import annotations

from dataclasses import replace

from .effect import Built, Effect, Here, Make, number, quantile
from .laws import BROAD, GRAVITY, SHARP
from .plant import Body, Fault, Opening, Power, Rim, Vortex


def overflow_sharp(here: Here) -> Built:
    """A round rim takes any flow within millimetres; `size` is the share of time it acts."""
    height = here.level(1.0 - here.size)
    return _with_rim(here, height, SHARP * here.random.uniform(8.0, 16.0))


def overflow_broad(here: Here) -> Built:
    """A notch of `size` cm in the wall; the level can rise above its base."""
    return _with_rim(here, here.level(here.between(0.3, 0.6)), BROAD * here.size)


def _with_rim(here: Here, height: float, strength: float) -> Built:
    caught = here.between(0.15, 0.75) if here.scene.below(here.place) else 0.0
    values = {
        "height": (height, "cm"),
        "strength": (strength, "cm**1.5/s"),
        "caught": (caught, "1"),
    }
    return here.changed(values, rim=Rim(height, strength, caught))


def resistance(here: Here) -> float:
    """Return the laminar resistance of a narrow outlet, `size` times its turbulent part."""
    return here.size * 0.5 * here.usual_fall / (GRAVITY * here.tank.outlet**2)


def power(sign: float) -> Make:
    """Return an effect: the exponent of the outlet is above 0.5, or below, if it chokes."""

    def make(here: Here) -> Built:
        exponent, level = 0.5 + sign * here.size, here.level(0.5)
        values = {"exponent": (exponent, "1"), "level": (level, "cm")}
        return here.changed(values, power=Power(exponent, level))

    return make


def evaporation(here: Here) -> Built:
    """Every tank loses the same flow at any level; the place is the first tank."""
    flow, plant = here.size * here.usual_fall, here.plant
    for tank in plant.tanks:
        plant = plant.with_tank(replace(tank, seepage=tank.seepage + flow))
    return Built(plant, {"flow of each tank": (flow, "cm3/s")})


def body(here: Here) -> Built:
    """A body stands in the tank on the share `size` of its floor."""
    inside = Body(here.size * here.tank.area, here.level(here.between(0.5, 0.75)))
    values = {"area": (inside.area, "cm2"), "height": (inside.height, "cm")}
    return here.changed(values, body=inside)


def leak(here: Here) -> Built:
    """An orifice to the outside opens at some time, `size` of the outlet."""
    fault = Fault(here.size * here.tank.outlet, here.scene.time_at(here.between(0.35, 0.65)))
    return here.changed({"area": (fault.size, "cm2"), "begin": (fault.begin, "s")}, leak=fault)


def clogging(here: Here) -> Built:
    """A part of the outlet closes at some time."""
    fault = Fault(here.size, here.scene.time_at(here.between(0.35, 0.65)))
    return here.changed({"share": (here.size, "1"), "begin": (fault.begin, "s")}, clog=fault)


def end_of_pipe(here: Here) -> float:
    """Return the level of the next tank at which it drowns the outlet's pipe and holds it back."""
    below = here.scene.below(here.place)
    assert below is not None
    return (1.0 - here.size) * float(here.scene.levels(below).max())


def side(here: Here) -> Built:
    """An opening in the wall, `size` of the outlet."""
    height = here.level(here.between(0.2, 0.6))
    hole = Opening(here.size * here.tank.outlet, height)
    return here.changed({"area": (hole.area, "cm2"), "height": (height, "cm")}, side=hole)


def diameter(here: Here) -> float:
    """Return the diameter of a lying cylinder; `size` is its largest filling."""
    return float(here.scene.levels(here.place).max()) / here.size


def vortex(here: Here) -> Built:
    """An air core narrows the outlet above a flow, and the outflow surges."""
    flow = quantile(here.scene.falling(here.place), here.between(0.35, 0.6))
    core = Vortex(flow, here.size, here.between(30.0, 90.0))
    values = {"flow": (flow, "cm3/s"), "share": (here.size, "1"), "period": (core.period, "s")}
    return here.changed(values, vortex=core)


TANK_EFFECTS = (
    Effect("overflow-sharp", "round rim", "physics", "tank", 0.02, 0.8, overflow_sharp),
    Effect("overflow-broad", "notch in the rim", "physics", "tank", 0.01, 8.0, overflow_broad),
    Effect("laminar", "outlet with laminar part", "physics", "tank", 0.02, 6.0,
           number("laminar", "laminar", "s/cm2", resistance)),
    Effect("power-high", "outlet with high exponent", "physics", "tank", 0.02, 0.6, power(1.0)),
    Effect("power-low", "outlet with low exponent", "physics", "tank", 0.02, 0.4, power(-1.0)),
    # Above the floor that the sensor counts from.
    Effect("outlet-height", "outlet above the floor", "physics", "tank", 0.2, 3.0,
           number("height", "height", "cm")),
    Effect("seepage", "constant seepage", "physics", "tank", 0.005, 0.5,
           number("seepage", "flow", "cm3/s", lambda here: here.size * here.usual_fall)),
    Effect("evaporation", "constant loss of each tank", "physics", "tank", 0.003, 0.3, evaporation),
    # Area gained per cm as share of the floor.
    Effect("growing-area", "walls lean outwards", "physics", "tank", 0.005, 0.6,
           number("growth", "growth", "cm2/cm", lambda here: here.size * here.tank.area)),
    Effect("body", "something stands in the tank", "physics", "tank", 0.05, 0.85, body),
    Effect("leak", "leak that begins", "fault", "tank", 0.01, 1.0, leak),
    Effect("clogging", "outlet clogs at once", "fault", "tank", 0.02, 0.8, clogging),
    Effect("drowned", "outlet drowns in the next tank", "physics", "tank", 0.05, 1.0,
           number("drowned", "end of the pipe", "cm", end_of_pipe)),
    # At the floor, too; the size of both is a share of the outlet.
    Effect("link", "second pipe to the next tank", "physics", "tank", 0.01, 2.0,
           number("link", "area", "cm2", lambda here: here.size * here.tank.outlet)),
    Effect("drain", "cock at the floor is open", "physics", "tank", 0.01, 1.0,
           number("drain", "area", "cm2", lambda here: here.size * here.tank.outlet)),
    Effect("side", "opening in the wall", "physics", "tank", 0.02, 3.0, side),
    # Width gained per cm as share of that at the floor.
    Effect("cone", "funnel", "physics", "tank", 0.003, 0.3, number("cone", "widening", "1/cm")),
    Effect("lying", "lying cylinder", "physics", "tank", 0.3, 0.98,
           number("lying", "diameter", "cm", diameter)),
    # Growth of its resistance over the record.
    Effect("closing", "outlet fouls", "physics", "tank", 0.01, 1.5,
           number("closing", "growth", "1/s", lambda here: here.size / here.record)),
)  # fmt: skip

VORTEX = Effect("vortex", "air core, outflow surges", "unnamed", "tank", 0.02, 0.6, vortex)
"""No catalogue names it; the right answer is its place."""
