"""Count how often the right fault is named first: `python -m tests.rig.isolation [TABLE...]`.

Each recording has sensor errors of its own; calibrations are made as a maker makes them, from a
bench recording with errors of its own, and taken in turn. It prints JSON. Recordings are made and
judged as in `tests.rig.mixing_rig`.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rulec.prove.truth import INSIDE, RIGS, TABLE_1, operating_points
from rulec.prove.truth.runs import HOLD
from tests.campaign import campaign, single_faults
from tests.rig.mixing_rig.cases import ALARM_HOLD, Task
from tests.rig.mixing_rig.judge import run
from tests.rig.mixing_rig.measure import sound_form, table_form

MODE = ("default",)
STRIDE = 1_003
"""Seeds between two repetitions: more than the plant has cases, and no multiple of the draws."""

PLANT = "abc"
STOPS = 25
"""Operating points of a fault-free recording."""


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

    degrees: tuple[float, ...] = (0.1, 0.2, 0.3)
    repetitions: int = 10
    draws: int = 61
    faults: tuple[str, ...] = ()
    samples: int = 100_000


def sound_start(scale: Scale) -> list[Task]:
    """Every fault with every degree, at one operating point that is sound for 10 s before."""
    plant = RIGS[PLANT]()
    faults = [f for f in single_faults(plant, scale.degrees) if _asked(f, scale.faults)]
    visit = operating_points(plant, 1)
    tasks = []
    for repetition in range(scale.repetitions):
        for k, fault in enumerate(faults):
            seed = 100_000 + STRIDE * repetition + k
            (case,) = campaign(plant, [fault], [visit], seed, HOLD)
            draw, plateaus = seed % scale.draws, ((HOLD, 2 * HOLD),)
            tasks.append(Task(PLANT, "sound-start", draw, case, TABLE_1, plateaus, MODE))
    return tasks


def sound(scale: Scale) -> list[Task]:
    """Fault-free tours of drawn plants, sensors inside their bounds."""
    plant = RIGS[PLANT]()
    recordings = -(-scale.samples // (STOPS * ALARM_HOLD))
    points = operating_points(plant, recordings * STOPS)
    tasks = []
    for k in range(recordings):
        visit = points[k::recordings]
        (case,) = campaign(plant, [{}], [visit], 500_000 + k, lead_in=0, hold=ALARM_HOLD)
        tasks.append(Task(PLANT, "sound", k % scale.draws, case, INSIDE, (), MODE, spread=True))
    return tasks


TABLES: Mapping[str, Callable[[Scale], list[Task]]] = {"sound-start": sound_start, "sound": sound}


def _asked(fault: Mapping[str, float], parts: tuple[str, ...]) -> bool:
    return not parts or any(part in name for part in parts for name in fault)


def main() -> None:
    """Ask the tables one after the other."""
    parser = argparse.ArgumentParser(prog="python -m tests.rig.isolation", description=__doc__)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--degrees", default="0.1,0.2,0.3", help="default 0.1,0.2,0.3")
    parser.add_argument("--repetitions", type=int, default=10, help="of each case (default 10)")
    parser.add_argument("--draws", type=int, default=61, help="calibrations (default 61)")
    parser.add_argument("--samples", type=int, default=100_000, help="sound ones (default 100000)")
    parser.add_argument("--faults", nargs="*", default=(), help="parts of names, such as P_el")
    parser.add_argument("--workers", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--json", choices=["-"], help="standard output, as without it")
    options = parser.parse_args()
    if strangers := set(options.tables) - set(TABLES):
        parser.error(f"no table {', '.join(sorted(strangers))}")
    scale = Scale(
        tuple(float(x) for x in options.degrees.split(",")),
        options.repetitions,
        options.draws,
        tuple(options.faults),
        options.samples,
    )
    form = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.tables or TABLES:
            judged = run(Path(folder), TABLES[name](scale), options.workers)
            form[name] = sound_form(judged.covered) if name == "sound" else table_form(judged)
    print(json.dumps(form, indent=1))


if __name__ == "__main__":
    main()
