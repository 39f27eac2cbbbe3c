"""For tests of the truth of tanks: a plant of three tanks, its true parameters with units,
its volumes, and instruments without errors."""

from collections.abc import Mapping

import numpy as np
from rulec_runtime.simulation.balances import Balances, Course
from scipy.integrate import cumulative_trapezoid

from rulec.prove.truth.tanks.build import LITRE_PER_HOUR, Setup
from rulec.prove.truth.tanks.plan import Case, Planned
from rulec.prove.truth.tanks.plant import CASCADED, Layout, Numbers, Plant, law

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
    found = {} if layout.metered else {f"{layout.feed}.k": (plant.feed["gain"], UNITS["k"])}
    for name, tank in plant.tanks.items():
        found[f"{name}.A"] = tank["area"], UNITS["A"]
        found[f"{name}.a"] = tank["outlet"], UNITS["a"]
        found[f"{name}.h0"] = tank["start"], UNITS["h0"]
    for name, sensor in plant.sensors.items():
        found[f"{name}.g"] = sensor["gain"], UNITS["g"]
    return found


def volumes(tank: Numbers, levels: np.ndarray) -> np.ndarray:
    """Return the volumes below levels, cm3: the integral of the surface, by trapezoids."""
    fine = np.linspace(min(0.0, levels.min()), levels.max(), 20001)
    flow = law("flows", tank)
    surface = np.array([flow(level, 0.0, 0.0, 0.0)[-1] for level in fine.tolist()])
    return np.interp(levels, fine, cumulative_trapezoid(surface, fine, initial=0.0))


def without_errors(setup: Setup) -> Plant:
    """The plant with instruments that have no systematic error."""
    plant, metered = setup.plant, setup.layout.metered
    gain = LITRE_PER_HOUR if metered else plant.feed["gain"]
    for tank in plant.sensors:
        plant = plant.with_(f"{tank}.y", zero=0.0)
    return plant.with_(setup.layout.feed, zero=0.0, gain=gain)


def by_the_tool(
    balances: Balances, values: Mapping[str, float], setup: Setup, pieces: int
) -> Course:
    """The tool's model with these values, each sample cut in pieces."""
    count = (setup.time.size - 1) * pieces + 1
    time = setup.layout.interval / pieces * np.arange(float(count))
    given = setup.shown * (1e-6 * LITRE_PER_HOUR if setup.layout.metered else 1.0)
    fine = np.append(np.repeat(given[:-1], pieces), given[-1])
    inputs = np.stack([time if n == "time" else fine for n in balances.inputs], 1)
    return balances.run(time, inputs, np.array([n != "time" for n in balances.inputs]), values)
