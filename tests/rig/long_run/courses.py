"""Sixty drawn courses of a degree: is the last one told, and when it will reach more?"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array

from tests.rig.long_run import plants
from tests.rig.long_run.plants import Columns, asked, clock, constant, last_of, moving, names_of

DRAWN = 60

SCALES: dict[str, tuple[int, float]] = {
    "10 minutes": (600, 1.0),
    "day, 10 s": (8_640, 10.0),
    "day, minute": (1_440, 60.0),
    "six weeks": (1_008, 3_600.0),
}
"""Rows, and seconds between them."""

SHAPES = ("linear", "accelerating", "steps")

FAULTS: dict[str, tuple[float, float]] = {
    "A.leakage": (0.1, 0.6),
    "B.leakage": (0.1, 0.6),
    "A.clogging": (0.3, 2.0),
    "B.clogging": (0.3, 2.0),
    "A.dp.high": (0.05, 0.2),
    "B.P_el.high": (0.1, 0.25),
}
"""Least and largest degree at the end."""

BEYOND = 20.0
"""Lengths of the recording within which the truth is followed on."""


@dataclass(frozen=True)
class Course:
    """A degree over time, s, that goes on behind the recording.

    Attributes
    ----------
    begins, ends : when it leaves zero, and when the recording ends, s
    last : degree at the end, 1
    power : 1 for a straight course, more for one that accelerates
    steps : part of the way from `begins` to `ends` of each step; none for a smooth course
    """

    begins: float
    ends: float
    last: float
    power: float
    steps: tuple[float, ...] = ()

    def __call__(self, time: Array) -> Array:
        """Degree, shape of `time`."""
        along = np.maximum((time - self.begins) / (self.ends - self.begins), 0.0)
        if self.steps:
            done = np.searchsorted(np.array(self.steps), along, side="right")
            of = int(np.searchsorted(np.array(self.steps), 1.0, side="right"))
            return self.last * done / of
        return np.asarray(self.last * along**self.power)

    def reaches(self, degree: float) -> float:
        """When it truly is there, s; infinite where that is far behind the recording."""
        time = self.begins + np.linspace(0.0, BEYOND, 400_001) * (self.ends - self.begins)
        there = self(time) >= degree
        return float(time[np.argmax(there)]) if there.any() else np.inf


@dataclass(frozen=True)
class Drawn:
    """One of the courses, and how the plant is run meanwhile."""

    number: int
    rig: str
    scale: str
    shape: str
    moves: bool
    fault: str
    course: Course

    @property
    def what(self) -> str:
        points = "moving" if self.moves else "constant"
        return f"{self.number} {self.rig}, {self.fault}, {self.scale}, {self.shape}, {points}"


def draw(number: int) -> Drawn:
    """One course; kinds come in turn, sizes are drawn."""
    random = np.random.default_rng([50, number])
    scale, shape = list(SCALES)[number % 4], SHAPES[number // 4 % 3]
    moves, rig = bool(number // 12 % 2), ("abc", "mixing-rig")[number % 5 == 4]
    fault = list(FAULTS)[int(random.choice(len(FAULTS), p=[0.2, 0.2, 0.2, 0.2, 0.1, 0.1]))]
    rows, interval = SCALES[scale]
    ends = (rows - 1) * interval
    begins = ends * float(random.choice([0.0, random.uniform(0.1, 0.5)]))
    power = float(random.uniform(1.5, 2.5)) if shape == "accelerating" else 1.0
    steps: tuple[float, ...] = ()
    if shape == "steps":
        gaps = random.gamma(4.0, 1.0 / (4.0 * random.integers(3, 8)), 400)
        # The last step before the end is a while ago, so that its degree can be seen.
        steps = tuple(np.cumsum(gaps).tolist())
        steps = tuple(s for s in steps if not 0.93 < s <= 1.0) if steps[0] < 0.93 else (0.5, *steps)
    last = float(random.uniform(*FAULTS[fault]))
    return Drawn(number, rig, scale, shape, moves, fault, Course(begins, ends, last, power, steps))


def readings_of(drawn: Drawn) -> Columns:
    rows, interval = SCALES[drawn.scale]
    time = clock(rows, interval)
    random = np.random.default_rng([51, drawn.number])
    dwell = int(random.integers(20, 60)) if interval < 3600.0 else int(random.integers(12, 48))
    speed = moving(drawn.rig, time, dwell, random) if drawn.moves else constant(drawn.rig, time)
    degree = drawn.course(time)
    return plants.recorded(
        drawn.rig, time, 7_000 + drawn.number, {drawn.fault: degree}, speed=speed
    )


def measure() -> dict[str, Any]:
    """How often what is told is right, and what is told of every course."""
    said = [said_of(draw(number)) for number in range(DRAWN)]
    counted = ("named", "degree_right", "forecast_holds")
    counts = {name: f"{sum(one[name] for one in said)} of {len(said)}" for name in counted}
    return {"counts": counts, "courses": said}


def said_of(drawn: Drawn) -> dict[str, Any]:
    """What is told of one: its degree with bounds, when it reaches another one; and the truth."""
    form, course = asked(drawn.rig, readings_of(drawn)), drawn.course
    finding = last_of(form, drawn.fault) or {}
    true, now = float(course(np.array(course.ends))), plants.now_of(finding) if finding else None
    reaches = finding.get("reaches")
    truly = None if reaches is None else course.reaches(float(reaches["degree"]))
    return {
        "what": drawn.what,
        "true": true,
        "now": now,
        "reaches": reaches,
        "truly": truly,
        "named": any(drawn.fault in names_of(f) for f in form["findings"]),
        "degree_right": now is not None and plants.is_within(now, true),
        "forecast_holds": truly is not None and reaches["earliest"] <= truly <= reaches["latest"],
    }
