"""What is recorded: every experiment as a list of tasks, their seeds fixed in advance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from rulec.prove.truth import (
    INSIDE,
    RIGS,
    TABLE_1,
    Case,
    Plant,
    Sensing,
    campaign,
    fault_pairs,
    leakage_replay,
    operating_points,
    settling,
    single_faults,
)
from rulec.prove.truth.runs import DEGREES as PLATEAUS
from rulec.prove.truth.runs import HOLD, Speeds

BOTH = ("default", "paper")
PUMPS = {
    "abc": {"A": "pcp", "B": "pcp", "C": "mixer"},
    "mixing-rig": {
        **dict.fromkeys("ABC", "pcp"),
        "D": "membrane",
        "E": "centrifugal",
        **dict.fromkeys(("M1", "M2"), "mixer"),
    },
}
"""What a module is, by plant."""


@dataclass(frozen=True)
class Scale:
    """How many of everything. Draws are calibrations, each from a recording of its own; of lists
    of faults every `step`-th is taken."""

    draws: int
    step: int
    degrees: tuple[float, ...]
    points: int
    isolation_seeds: Mapping[str, int]
    isolation_degrees: tuple[float, ...]
    alarm_recordings: int
    alarm_points: int


FULL = Scale(
    draws=20,
    step=1,
    degrees=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8),
    points=4,
    isolation_seeds={"abc": 10, "mixing-rig": 2},
    isolation_degrees=(0.1, 0.2, 0.3),
    alarm_recordings=100,
    alarm_points=25,
)
QUICK = Scale(
    draws=1,
    step=20,
    degrees=(0.4,),
    points=1,
    isolation_seeds={"abc": 1, "mixing-rig": 0},
    isolation_degrees=(0.3,),
    alarm_recordings=1,
    alarm_points=2,
)
ALARM_HOLD = 40  # samples at each operating point of a fault-free recording
TOUR = 5  # operating points in a recording that visits several


@dataclass(frozen=True)
class Task:
    """One recording to be made and judged.

    Attributes
    ----------
    group : which of the experiment's figures it counts for
    draw : number of the calibration
    plateaus : first sample, and the one behind the last, of each plateau that is scored
    samples : whether every sample is judged on its own as well
    spread : whether the plant is off its data sheet, another one for each draw
    """

    plant: str
    group: str
    draw: int
    case: Case
    sensing: Sensing
    plateaus: tuple[tuple[int, int], ...]
    modes: tuple[str, ...] = BOTH
    samples: bool = False
    spread: bool = False


def leakage(scale: Scale) -> list[Task]:
    """Leakage in A, plateaus 0, 0.2, 0, 0.4, 0, 0.6, on both plants, a draw each time."""
    plateaus = tuple((k * HOLD, (k + 1) * HOLD) for k, x in enumerate(PLATEAUS) if x > 0)
    tasks = []
    for plant in PUMPS:
        run = settling(leakage_replay(RIGS[plant]()))
        for draw in range(scale.draws):
            case = Case({"A.leakage": max(PLATEAUS)}, run, 1_000 + draw)
            tasks.append(Task(plant, plant, draw, case, TABLE_1, plateaus, BOTH, samples=True))
    return tasks


def degrees(scale: Scale) -> list[Task]:
    """All faults of the rig over degrees and operating points, healthy before."""
    plant = RIGS["mixing-rig"]()
    visits = [[point] for point in operating_points(plant, scale.points)]
    faults = single_faults(plant, scale.degrees)[:: scale.step]
    cases = campaign(plant, faults, visits, first_seed=10_000)
    return _tasks("mixing-rig", "all faults", cases, 1, scale, BOTH)


def isolation(scale: Scale) -> list[Task]:
    """All faults of both plants at small degrees, at one operating point and at five."""
    tasks: list[Task] = []
    for plant, seeds in scale.isolation_seeds.items():
        for stops, visits in _one_and_five(RIGS[plant]()):
            for seed in range(seeds):
                faults = single_faults(RIGS[plant](), scale.isolation_degrees)[:: scale.step]
                first = 100_000 + 10_000 * stops + 1_003 * seed  # prime to the number of draws
                cases = campaign(RIGS[plant](), faults, visits, first)
                tasks += _tasks(plant, _stops(plant, stops), cases, stops, scale, ("default",))
    return tasks


def pairs(scale: Scale) -> list[Task]:
    """Two faults at once in abc, at one operating point and at five."""
    tasks: list[Task] = []
    plant = RIGS["abc"]()
    for stops, visits in _one_and_five(plant):
        faults = fault_pairs(plant)[:: scale.step]
        cases = campaign(plant, faults, visits, first_seed=200_000 + 10_000 * stops)
        tasks += _tasks("abc", _stops("abc", stops), cases, stops, scale, ("default",))
    return tasks


def alarms(scale: Scale) -> list[Task]:
    """Fault-free: each recording with its own calibration, sensors and operating points."""
    plant = RIGS["mixing-rig"]()
    points = operating_points(plant, scale.alarm_recordings * scale.alarm_points)
    tasks = []
    for draw in range(scale.alarm_recordings):
        visit = points[draw :: scale.alarm_recordings]
        (case,) = campaign(plant, [{}], [visit], 300_000 + draw, lead_in=0, hold=ALARM_HOLD)
        tasks.append(Task("mixing-rig", "healthy", draw, case, INSIDE, (), BOTH, samples=True))
    return tasks


EXPERIMENTS: Mapping[str, Callable[[Scale], list[Task]]] = {
    "leakage": leakage,
    "degrees": degrees,
    "isolation": isolation,
    "pairs": pairs,
    "alarms": alarms,
}


def _one_and_five(plant: Plant) -> list[tuple[int, list[Sequence[Speeds]]]]:
    """Visits of one and of several operating points."""
    points = operating_points(plant, TOUR)
    return [(1, [points[:1]]), (TOUR, [points])]


def _stops(plant: str, stops: int) -> str:
    return f"{plant}, {stops} operating point{'s' * (stops > 1)}"


def _tasks(
    plant: str, group: str, cases: list[Case], stops: int, scale: Scale, modes: tuple[str, ...]
) -> list[Task]:
    """Cases with a lead-in, their draws in turn."""
    plateaus = tuple((HOLD * k, HOLD * (k + 1)) for k in range(1, stops + 1))
    return [
        Task(plant, group, case.seed % scale.draws, case, TABLE_1, plateaus, modes)
        for case in cases
    ]
