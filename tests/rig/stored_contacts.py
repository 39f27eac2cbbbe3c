"""`diagnose` at first contact with plants that store: rows of tanks of an independent simulator.

Their parameters are as uncertain as the module types say, laws within their accuracy, sensors
within their class. From three quarters on a tank has a hole, or a level sensor's zero has shifted.
``python -m tests.rig.stored_contacts`` prints as JSON how many sound plants have a finding, and in
how many of the others the tank or the sensor is told, or something else alone; then how many of
the told degrees have the true one within their bounds.
"""

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.recordings.recording import read_recording

from rulec.passes.pipeline import compile_plant
from rulec.prove.truth.recording import write_csv
from rulec.prove.truth.tanks.balance import integrate
from rulec.prove.truth.tanks.build import build, recorded_input
from rulec.prove.truth.tanks.plant import CASCADED, Layout
from rulec.prove.truth.tanks.rows import row, write_plant
from rulec.prove.truth.tanks.sensing import shown

FIRST, CASES = 8001, 20
HOLE, SHIFT = 0.2, 0.5
"""Area of a hole over that of the outlet; shift of a zero, V."""
LOSSES = "hole", "leak", "lost-inflow"
"""Faults of a tank that a hole may be told as."""


@dataclass(frozen=True)
class Contact:
    """A plant by seed: every other one is the shipped plant, the others are random rows."""

    seed: int

    def diagnosed(self, hole: bool = False, shift: bool = False) -> Diagnosis:
        """The diagnosis of its recording, with what begins at three quarters of it."""
        setup = build(self.layout, self.seed, difficulties=("form",))
        begin, plant = setup.time[3 * len(setup.time) // 4], setup.plant
        if hole:
            area = HOLE * plant.tanks[self.tank]["outlet"]
            plant = plant.with_(self.tank, leak=area, leak_begin=float(begin))
        levels = shown(plant, integrate(plant, setup.time, setup.shown), self.seed)
        if shift:
            levels[self.sensor] = levels[self.sensor] + SHIFT * (setup.time >= begin)
        columns = {
            "time [s]": setup.time,
            self.layout.input_column: recorded_input(setup, self.seed),
        }
        columns |= {self.layout.columns[tank]: level for tank, level in levels.items()}
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "recording.csv"
            write_plant(self.layout, Path(folder) / "plant")
            write_csv(file, columns)
            ruleset = compile_plant(Path(folder) / "plant")
            return diagnose(read_recording(file, ruleset), ruleset)

    @property
    def layout(self) -> Layout:
        """Its drawing."""
        return CASCADED if self.seed % 2 else row(self.seed)

    @property
    def tank(self) -> str:
        """The tank with the hole."""
        return self.layout.tanks[self.seed // 2 % len(self.layout.tanks)]

    @property
    def sensor(self) -> str:
        """The tank whose level sensor is wrong."""
        return self.layout.measured[0]


def told(diagnosis: Diagnosis, right: tuple[str, ...]) -> bool | None:
    """Whether a cause begins as one of some names; None if nothing is found."""
    causes = {n for f in diagnosis.findings for n in (f.fault.id, *(o for o, _ in f.alternatives))}
    return any(name.startswith(right) for name in causes) if causes else None


def covers(finding: Finding, degree: float) -> bool:
    """Whether the told bounds hold a degree."""
    return finding.lower <= degree <= finding.upper


def figures() -> dict[str, dict[str, int]]:
    """All figures, as counts of cases."""
    cases = [Contact(seed) for seed in range(FIRST, FIRST + CASES)]
    sound = [case.diagnosed() for case in cases]
    holes = [case.diagnosed(hole=True) for case in cases]
    shifts = [case.diagnosed(shift=True) for case in cases]
    lost = [
        told(d, tuple(f"{c.tank}.{x}" for x in LOSSES)) for c, d in zip(cases, holes, strict=True)
    ]
    wrong = [told(d, (f"{c.sensor}.y",)) for c, d in zip(cases, shifts, strict=True)]
    degrees = [
        covers(f, truth)
        for kind, truth, all_ in (("hole", HOLE / (1 + HOLE), holes), ("zero-shift", SHIFT, shifts))
        for d in all_
        for f in d.findings
        if f.fault.fault == kind
    ]
    return {
        "alarms": {"count": sum(bool(d.findings or d.unknown) for d in sound), "of": len(sound)},
        "holes": {"count": lost.count(True), "of": len(lost)},
        "shifts": {"count": wrong.count(True), "of": len(wrong)},
        "astray": {"count": [*lost, *wrong].count(False), "of": len([*lost, *wrong])},
        "covered": {"count": sum(degrees), "of": len(degrees)},
    }


if __name__ == "__main__":
    print(json.dumps(figures()))
