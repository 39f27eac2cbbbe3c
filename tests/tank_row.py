"""For tests of the truth of tanks: a plant of three tanks, the inflow metered, two levels measured;
true parameters with their units, and volumes.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rulec.prove.truth.tanks import Layout
from rulec.prove.truth.tanks.build import Setup
from rulec.prove.truth.tanks.plant import Tank

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
