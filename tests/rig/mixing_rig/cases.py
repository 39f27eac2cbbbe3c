"""What is recorded: every experiment as a list of tasks, their seeds fixed in advance."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tests.campaign import Case, campaign, single_faults
from tests.dosing import (
    INSIDE,
    RIGS,
    TABLE_1,
    Sensing,
    fault_replay,
    operating_points,
    settling,
)
from tests.dosing.runs import DEGREES as PLATEAUS
from tests.dosing.runs import DWELL

BOTH = ("default", "paper")
PLANTS = ("abc", "mixing-rig")


START = "abc"
"""Plant of the experiments that begin sound."""

STRIDE = 1_003
"""Seeds between two repetitions: more than the plant has cases, and no multiple of the draws."""


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How many of everything. Draws are calibrations, each from a recording of its own; of lists
    of faults every `step`-th is taken. Those with `start` are of experiments that begin sound."""

    draws: int
    step: int
    degrees: tuple[float, ...]
    points: int
    alarm_recordings: int
    alarm_points: int
    start_draws: int
    start_degrees: tuple[float, ...]
    start_repetitions: int
    start_samples: int


FULL = Scale(
    draws=20,
    step=1,
    degrees=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8),
    points=4,
    alarm_recordings=100,
    alarm_points=25,
    start_draws=61,
    start_degrees=(0.1, 0.2, 0.3),
    start_repetitions=10,
    start_samples=100_000,
)
QUICK = Scale(
    draws=1,
    step=20,
    degrees=(0.4,),
    points=1,
    alarm_recordings=1,
    alarm_points=2,
    start_draws=1,
    start_degrees=(0.1,),
    start_repetitions=1,
    start_samples=3_000,
)
ALARM_DWELL = 40  # samples at each operating point of a fault-free recording


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
    plateaus = tuple((k * DWELL, (k + 1) * DWELL) for k, x in enumerate(PLATEAUS) if x > 0)
    tasks = []
    for plant in PLANTS:
        run = settling(fault_replay(RIGS[plant], "A.leakage"))
        for draw in range(scale.draws):
            case = Case({"A.leakage": max(PLATEAUS)}, run, 1_000 + draw)
            tasks.append(Task(plant, plant, draw, case, TABLE_1, plateaus, samples=True))
    return tasks


def degrees(scale: Scale) -> list[Task]:
    """All faults of the rig over degrees and operating points, healthy before."""
    plant = RIGS["mixing-rig"]
    visits = [[point] for point in operating_points(plant, scale.points)]
    faults = single_faults(plant, scale.degrees)[:: scale.step]
    cases = campaign(plant, faults, visits, first_seed=10_000)
    return [
        Task("mixing-rig", "all faults", c.seed % scale.draws, c, TABLE_1, ((DWELL, 2 * DWELL),))
        for c in cases
    ]


def alarms(scale: Scale) -> list[Task]:
    """Fault-free: each recording with its own calibration, sensors and operating points."""
    plant = RIGS["mixing-rig"]
    points = operating_points(plant, scale.alarm_recordings * scale.alarm_points)
    tasks = []
    for draw in range(scale.alarm_recordings):
        visit = points[draw :: scale.alarm_recordings]
        (case,) = campaign(plant, [{}], [visit], 300_000 + draw, lead_in=0, dwell=ALARM_DWELL)
        tasks.append(Task("mixing-rig", "healthy", draw, case, INSIDE, ()))
    return tasks


def sound_start(scale: Scale) -> list[Task]:
    """Every fault with every degree, at one operating point that is sound for 10 s before."""
    plant = RIGS[START]
    visit, tasks = operating_points(plant, 1), []
    for repetition in range(scale.start_repetitions):
        for k, fault in enumerate(single_faults(plant, scale.start_degrees)):
            seed = 100_000 + STRIDE * repetition + k
            (case,) = campaign(plant, [fault], [visit], seed, DWELL)
            draw, plateaus = seed % scale.start_draws, ((DWELL, 2 * DWELL),)
            tasks.append(Task(START, "sound-start", draw, case, TABLE_1, plateaus, BOTH[:1]))
    return tasks


def sound(scale: Scale) -> list[Task]:
    """Fault-free tours of drawn plants, sensors inside their bounds."""
    plant, stops = RIGS[START], FULL.alarm_points
    recordings = -(-scale.start_samples // (stops * ALARM_DWELL))
    points, tasks = operating_points(plant, recordings * stops), []
    for k in range(recordings):
        visit, draw = points[k::recordings], k % scale.start_draws
        (case,) = campaign(plant, [{}], [visit], 500_000 + k, lead_in=0, dwell=ALARM_DWELL)
        tasks.append(Task(START, "sound", draw, case, INSIDE, (), BOTH[:1], spread=True))
    return tasks


EXPERIMENTS: Mapping[str, Callable[[Scale], list[Task]]] = {
    "leakage": leakage,
    "degrees": degrees,
    "alarms": alarms,
    "sound-start": sound_start,
    "sound": sound,
}
