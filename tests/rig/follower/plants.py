"""Recordings of plants in which faults come and go."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import follow
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.recording import Recording

from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with


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


@dataclass(frozen=True)
class Followed:
    """A recording, row by row or in blocks: all that was told, and the diagnosis in the end."""

    memory: Memory
    events: tuple[Event, ...]
    diagnosis: Diagnosis


def followed(ruleset: Ruleset, recording: Recording, step: int) -> Followed:
    memory, events = nothing_yet(False), list[Event]()
    for first in range(0, len(recording), step):
        for update in follow(ruleset, memory, part_of(recording, first, first + step)):
            memory = update.memory
            events += update.events
    return Followed(memory, tuple(events), update.diagnosis)


def first_rows(recording: Recording, rows: int) -> Recording:
    return replace(
        recording,
        time=recording.time[:rows],
        values={name: column[:rows] for name, column in recording.values.items()},
        segment=recording.segment[:rows],
    )
