"""A year of one sound plant at a point a minute: what is told of it is a false alarm.

The liquid is warm in summer and cold in winter, sensors drift inside their class, set points change
with every shift.
"""

from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.prove.truth.smooth import Drift
from tests.dosing import Sensing, record
from tests.dosing.plant import LIQUID_TEMPERATURE, Operation
from tests.dosing.runs import HIGHEST, LOWEST, Run
from tests.rig.long_run import plants
from tests.rig.long_run.plants import Columns, asked, in_a_line, plant

RIG, SEED = "abc", 0
ROWS, MINUTE = 1_440, 60.0
YEAR = 365

SHIFT = 480
"""Rows with the same set points: eight hours."""

SEASON = 4.0
"""Kelvin by which the liquid is warmer in summer than on average, and a quarter of that in the
afternoon. Origin: assumed; a plant in a hall."""

TURNS = 6
"""How often the error of a sensor turns within a year. Origin: assumed."""


def day_of(day: int) -> Columns:
    """Readings of one day."""
    time = MINUTE * (ROWS * day + np.arange(ROWS, dtype=np.float64))
    days = time / 86_400.0
    colder = np.cos(2.0 * np.pi * days / YEAR) + np.cos(2.0 * np.pi * (days - 0.125)) / 4.0
    temperature = LIQUID_TEMPERATURE - SEASON * colder
    built, faults = plants.water_at(plant(RIG), temperature)
    random = np.random.default_rng([54, SEED, day])
    speed = {}
    for name, module in built.modules.items():
        share = np.repeat(random.uniform(LOWEST, HIGHEST, ROWS // SHIFT), SHIFT)
        speed[name] = module.slowest + share * (module.fastest - module.slowest)
    everywhere = dict.fromkeys(built.modules, temperature)
    run = Run(built, Operation(time, speed, temperature=everywhere), faults)
    noisy = record(run, Sensing(systematic=False), 1_000 * SEED + day).readings
    return _with_drifts(noisy, day)


def measure() -> dict[str, Any]:
    """All that is told of the days of a year, each on its own, as false alarms."""
    alarms = []
    for day in range(YEAR):
        form = asked(RIG, day_of(day))
        if form["findings"] or form["unknown"]:
            alarms.append({"day": day, "said": in_a_line(form)})
    return {"days": YEAR, "with_an_alarm": len(alarms), "alarms": alarms}


def _with_drifts(columns: Columns, day: int) -> Columns:
    """Errors of sensors that wander through their class within the year."""
    found, sensors = dict(columns), plant(RIG).rig.sensors
    for number, title in enumerate(name for name in columns if name != "time [s]"):
        sensor = sensors[title.split(" [")[0]]
        size: Array | float = np.abs(columns[title]) if sensor.relative else 1.0
        found[title] = columns[title] + _errors(day, number) * size * sensor.bound
    return found


def _errors(day: int, number: int) -> Array:
    """Of one sensor on one day, in its bound, never more than that."""
    random = np.random.default_rng([55, SEED, number])
    first, *turns = np.clip(random.standard_normal(TURNS + 1), -2.0, 2.0)
    along = Drift(1.0, np.array(turns))(float(first), YEAR + 1)
    return np.interp(day + np.arange(ROWS) / ROWS, np.arange(YEAR + 1.0), along) / 2.0
