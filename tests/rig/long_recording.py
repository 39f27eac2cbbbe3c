"""A long recording of plant abc: set points change, and leakages come and go."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with

PERIOD, HELD, FAULTY = 100_000, 2000, 1500
"""Rows after which readings repeat, of a set point, and of a fault."""

DEGREE, STARTS = 0.3, (20_500, 50_500, 80_500)


def readings(rules: Ruleset, rows: int, random: np.random.Generator) -> dict[str, Array]:
    """Readings by their titles, in the units of their sensors."""
    equations = equations_of(rules)
    given = {}
    for signal in equations.given_signals:
        share = random.uniform(0.85, 1.1, -(-rows // HELD))
        levels = signal.offset + (signal.reference - signal.offset) * share
        given[signal.id] = np.repeat(levels, HELD)[:rows]
    fault = next(f.id for f in rules.faults if not f.in_sensor and not f.unit)
    degree = np.zeros(rows)
    for start in STARTS:
        degree[start : start + FAULTY] = DEGREE
    simulated = simulate_with(equations, given, {fault: degree})
    values = sense(rules, simulated.values, SensorErrors(bounded=True), random)
    signals = rules.signal_by_id
    return {
        f"{name} [{signals[name].unit}]": (column - signals[name].offset) / signals[name].factor
        for name, column in values.items()
        if name in rules.observed
    }


def write(rules: Ruleset, rows: int, file: Path) -> None:
    """The same readings again and again, one row a second, as CSV."""
    made = readings(rules, min(rows, PERIOD), np.random.default_rng(7))
    table = np.column_stack(list(made.values()))
    lines = [",".join(f"{x:.6g}" for x in row) for row in table.tolist()]
    with file.open("w") as out:
        out.write(",".join(["time [s]", *made]) + "\n")
        for low in range(0, rows, PERIOD):
            count = min(PERIOD, rows - low)
            out.write("".join(f"{low + k},{lines[k]}\n" for k in range(count)))
