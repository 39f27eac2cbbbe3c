"""For tests of the truth of tanks: a plant of three tanks, its true parameters with units,
its volumes, and instruments without errors."""

from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rulec.prove.truth.tanks.build import CASCADED, LITRE_PER_HOUR, Layout, Setup
from rulec.prove.truth.tanks.plan import Case, Planned
from rulec.prove.truth.tanks.plant import Plant, Tank

SI = {"cm": 1e-2, "cm2": 1e-4, "cm3/s/V": 1e-6, "V/cm": 100.0}

ROW = Layout(
    "tank-row",
    "inflow",
    ("first", "middle", "last"),
    ("first", "last"),
    True,
    5.0,
    "F1 [l/h]",
    {"first": "L1 [V]", "last": "L3 [V]"},
)
"""The inflow metered, two levels measured."""


def case(
    seed: int,
    *effects: str,
    samples: int = 120,
    layout: Layout = CASCADED,
    group: str = "single",
    strength: float | None = None,
) -> Case:
    """Return a short case, also of effects that nobody could see."""
    return Planned("it", group, seed, layout, effects, samples, strength).drawn()


UNITS = {"k": "cm3/s/V", "A": "cm2", "a": "cm2", "g": "V/cm", "h0": "cm"}


def parameters(setup: Setup) -> dict[str, tuple[float, str]]:
    """Return the true base parameters with their units, without gains of absent sensors."""
    plant, layout = setup.plant, setup.layout
    found = {} if layout.metered else {f"{layout.feed}.k": (plant.feed.gain, UNITS["k"])}
    for tank in plant.tanks:
        found[f"{tank.name}.A"] = tank.area, UNITS["A"]
        found[f"{tank.name}.a"] = tank.outlet, UNITS["a"]
        found[f"{tank.name}.h0"] = tank.level, UNITS["h0"]
    for sensor in plant.sensors:
        found[f"{sensor.tank}.g"] = sensor.gain, UNITS["g"]
    return found


def volumes(tank: Tank, levels: np.ndarray) -> np.ndarray:
    """Return the volumes below levels, cm3: the integral of the surface, by trapezoids."""
    fine = np.linspace(min(0.0, levels.min()), levels.max(), 20001)
    surface = np.array([tank.surface(level) for level in fine.tolist()])
    return np.interp(levels, fine, cumulative_trapezoid(surface, fine, initial=0.0))


def without_errors(setup: Setup) -> Plant:
    """The plant with instruments that have no systematic error."""
    plant = setup.plant
    gain = LITRE_PER_HOUR if setup.layout.metered else plant.feed.gain
    sensors = tuple(replace(s, zero=0.0) for s in plant.sensors)
    return replace(plant, feed=replace(plant.feed, zero=0.0, gain=gain), sensors=sensors)
