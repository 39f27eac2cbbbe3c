"""Plants with 200 readings, and recordings of them in which faults come and go."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.recording import Recording

from rulec.passes.pipeline import compile_plant
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.conftest import ROOT

LINES = 29
"""Of seven readings each: 203."""


def side_by_side() -> Ruleset:
    """Many small plants in one file, two pumps and a mixer each, without connection."""
    modules, connections = [], []
    for i in range(LINES):
        modules += [f"  L{i}A: {{type: dosing-pcp}}", f"  L{i}B: {{type: dosing-pcp}}"]
        modules.append(f"  L{i}C: {{type: static-mixer}}")
        connections += [f"L{i}A -> L{i}C", f"L{i}B -> L{i}C"]
    head = ["plant: side-by-side", "title: side by side", f"kb: {ROOT / 'kb'}"]
    lines = [*head, "modules:", *modules, "connections:", *(f"  - {c}" for c in connections)]
    with tempfile.TemporaryDirectory(prefix="rulec-follower-") as folder:
        Path(folder, "plant.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return compile_plant(Path(folder))


@dataclass(frozen=True)
class Planted:
    fault: str
    degree: float
    first: int
    last: int


def recorded(
    ruleset: Ruleset,
    rows: int,
    planted: list[Planted],
    interval: float,
    random: np.random.Generator,
) -> Recording:
    """Readings at the reference point, with errors of sensors by their class; what a fault in a
    sensor scales is the reading, errors and all."""
    degrees: dict[str, Array] = {}
    for one in planted:
        column = degrees.setdefault(one.fault, np.zeros(rows))
        column[one.first : one.last] = one.degree
    shown = _simulated(ruleset, rows, degrees)
    scaled = {f.id: f.scales for f in ruleset.faults if f.in_sensor and f.id in degrees}
    gains = {}
    if scaled:
        others = {fault: degree for fault, degree in degrees.items() if fault not in scaled}
        true = _simulated(ruleset, rows, others)
        gains = {name: shown[name] / true[name] for names in scaled.values() for name in names}
    values = sense(ruleset, shown, SensorErrors(bounded=True), random, gains)
    return Recording(
        time=interval * np.arange(float(rows)),
        values={name: column for name, column in values.items() if name in ruleset.observed},
        segment=np.zeros(rows, dtype=int),
        missing=(),
        notes=(),
    )


def _simulated(ruleset: Ruleset, rows: int, degrees: Mapping[str, Array]) -> Mapping[str, Array]:
    """What perfect sensors show at the reference point, SI."""
    equations = equations_of(ruleset)
    given = {s.id: np.full(rows, s.reference) for s in equations.given_signals}
    return simulate_with(equations, given, degrees).values


def part_of(recording: Recording, first: int, last: int) -> Rows:
    """Some of the rows, as a source gives them."""
    columns = {name: column[first:last] for name, column in recording.values.items()}
    return Rows(recording.time[first:last], columns)
