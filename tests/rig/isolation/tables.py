"""The tables as lists of tasks, their seeds fixed in advance."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from rulec.prove.truth import INSIDE, RIGS, TABLE_1, campaign, operating_points, single_faults
from rulec.prove.truth.runs import HOLD, Speeds
from tests.rig.mixing_rig.cases import ALARM_HOLD, TOUR, Task

MODE = ("default",)
STRIDE = 1_003
"""Seeds between two repetitions: more than a plant has cases, and no multiple of the draws."""


@dataclass(frozen=True)
class Scale:
    """How much is recorded.

    Attributes
    ----------
    degrees : of the faults
    repetitions : recordings of each fault with each degree
    draws : calibrations, each from a bench recording of its own; taken in turn
    faults : only those whose names hold one of these; all if empty
    samples : fault-free ones, at least
    """

    plant: str = "abc"
    degrees: tuple[float, ...] = (0.1, 0.2, 0.3)
    repetitions: int = 10
    draws: int = 61
    faults: tuple[str, ...] = ()
    samples: int = 100_000


@dataclass(frozen=True)
class Table:
    """A question: how many operating points, how long sound before, whether the plant is spread.

    `anywhere`: points all over the range in use, others in each recording; else the nominal one
    and the first four others.
    """

    title: str
    points: int
    lead_in: int
    spread: bool
    first_seed: int

    @property
    def anywhere(self) -> bool:
        """A plant off its data sheet is asked anywhere."""
        return self.spread

    def tasks(self, scale: Scale) -> list[Task]:
        """Every fault with every degree, repeated."""
        plant = RIGS[scale.plant]()
        faults = [f for f in single_faults(plant, scale.degrees) if _asked(f, scale.faults)]
        visits = self._visits(scale, len(faults) * scale.repetitions)
        return [
            self._task(scale, fault, next(visits), self.first_seed + STRIDE * repetition + k)
            for repetition in range(scale.repetitions)
            for k, fault in enumerate(faults)
        ]

    def _visits(self, scale: Scale, recordings: int) -> Iterator[list[Speeds]]:
        plant = RIGS[scale.plant]()
        if not self.anywhere:
            same = operating_points(plant, TOUR)[: self.points]
            return iter([same] * recordings)
        points = operating_points(plant, 1 + self.points * recordings)[1:]
        return iter([points[k::recordings] for k in range(recordings)])

    def _task(
        self, scale: Scale, fault: Mapping[str, float], visit: list[Speeds], seed: int
    ) -> Task:
        (case,) = campaign(RIGS[scale.plant](), [fault], [visit], seed, self.lead_in)
        starts = range(self.lead_in, self.lead_in + HOLD * self.points, HOLD)
        plateaus = tuple((start, start + HOLD) for start in starts)
        draw = seed % scale.draws
        return Task(
            scale.plant, self.title, draw, case, TABLE_1, plateaus, MODE, spread=self.spread
        )


TABLES: Mapping[str, Table] = {
    "sound-start": Table("sound for 10 s, one operating point", 1, HOLD, False, 100_000),
    "first-sample": Table("fault from the first sample, five points", TOUR, 0, False, 200_000),
    "sound-start-anywhere": Table(
        "sound for 10 s, one point anywhere, drawn plant", 1, HOLD, True, 300_000
    ),
    "first-sample-anywhere": Table(
        "fault from the first sample, five points anywhere, drawn plant", TOUR, 0, True, 400_000
    ),
}


def sound(scale: Scale) -> list[Task]:
    """Fault-free tours of drawn plants, sensors inside their bounds."""
    plant = RIGS[scale.plant]()
    stops = 25
    recordings = -(-scale.samples // (stops * ALARM_HOLD))
    points = operating_points(plant, recordings * stops)
    tasks = []
    for k in range(recordings):
        visit = points[k::recordings]
        (case,) = campaign(plant, [{}], [visit], 500_000 + k, lead_in=0, hold=ALARM_HOLD)
        tasks.append(
            Task(scale.plant, "sound", k % scale.draws, case, INSIDE, (), MODE, spread=True)
        )
    return tasks


ASKED: Mapping[str, Callable[[Scale], list[Task]]] = {
    **{name: table.tasks for name, table in TABLES.items()},
    "sound": sound,
}


def _asked(fault: Mapping[str, float], parts: tuple[str, ...]) -> bool:
    return not parts or any(part in name for part in parts for name in fault)
