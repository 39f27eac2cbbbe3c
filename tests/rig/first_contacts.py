"""`diagnose` at first contact: plants of an independent simulator, known from a data sheet alone.

Values are within the uncertainty of the sheet, laws within their accuracy, sensors within their
class; in half of the plants one law has another form. ``python -m tests.rig.first_contacts`` prints
as JSON how many healthy plants have a finding, how often a meter is blamed for a law of another
form, and how often a meter that is a fifth too high from the middle on is found; then how many
healthy plants are refused by `calibrate`, and how many have a finding behind it, where every other
part of a recording calibrates and the rest is diagnosed.
"""

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.recordings.recording import read_recording

import rulec
from rulec.passes.pipeline import compile_plant
from rulec.prove.truth.contacts import Planned, planned

FIRST, CASES = 7001, 160
METERS = "unit.dp", "unit.Q", "unit.P_el"
SURE = 0.9
PART = 40
"""Samples of a part of a recording that calibrates, or is diagnosed."""


def diagnosed(case: Planned, high: str = "", by: float = 0.2) -> Diagnosis:
    """The diagnosis of its recording; a meter may read too high from the middle on."""
    with tempfile.TemporaryDirectory() as folder:
        case.make().write(Path(folder))
        file = Path(folder) / "recording.csv"
        if high:
            shown = pd.read_csv(file)
            shown.loc[len(shown) // 2 :, column_of(shown, high)] *= 1.0 + by
            shown.to_csv(file, index=False)
        ruleset = compile_plant(Path(folder) / "plant")
        return diagnose(read_recording(file, ruleset), ruleset)


def calibrated(case: Planned) -> Diagnosis | None:
    """The diagnosis of every other part of its recording, calibrated with the rest; None where
    that is refused."""
    with tempfile.TemporaryDirectory() as folder:
        plant, fitted = Path(folder) / "plant", Path(folder) / "plant" / "calibration.yaml"
        case.make().write(Path(folder))
        shown = pd.read_csv(Path(folder) / "recording.csv")
        odd = np.arange(len(shown)) // PART % 2 == 1
        for name, rows in (("first.csv", shown[~odd]), ("second.csv", shown[odd])):
            rows.to_csv(Path(folder) / name, index=False)
        try:
            rulec.calibrate(plant, Path(folder) / "first.csv").write(fitted)
        except (rulec.Refused, rulec.CalibrationRefused):
            return None
        with (plant / "plant.yaml").open("a", encoding="utf-8") as file:
            file.write("calibration: [calibration.yaml]\n")
        ruleset = compile_plant(plant)
        return diagnose(read_recording(Path(folder) / "second.csv", ruleset), ruleset)


def column_of(shown: pd.DataFrame, signal: str) -> str:
    """The title of the column of a signal."""
    (title,) = (name for name in shown.columns if name.startswith(f"{signal} "))
    return str(title)


def causes(diagnosis: Diagnosis) -> set[str]:
    """All faults that are told as possible."""
    return {
        name
        for f in diagnosis.findings
        for name in (f.fault.id, *(other for other, _ in f.alternatives))
    }


def blames_a_meter(diagnosis: Diagnosis) -> bool:
    """Whether an error of a reading is told with 90 % or more, or a wrong unit."""
    sure = [f for f in diagnosis.findings if f.probability >= SURE and f.fault.in_sensor]
    return bool(sure or diagnosis.sensors)


def with_a_wrong_meter(cases: Iterator[Planned]) -> Iterator[tuple[str, Diagnosis]]:
    """Each case with one of its meters too high, in turn, and that meter's name."""
    for i, case in enumerate(cases):
        known = [m for m in METERS if m.removeprefix("unit.") in case.make().true]
        meter = known[i % len(known)]
        yield meter, diagnosed(case, meter)


def figures() -> dict[str, dict[str, int]]:
    """All figures, as counts of cases."""
    sound = [c for c in planned(FIRST, CASES) if not c.other]
    other = [diagnosed(c) for c in planned(FIRST, CASES) if c.other]
    wrong = list(with_a_wrong_meter(iter(sound)))
    alarmed = [d for d in map(diagnosed, sound) if d.findings or d.unknown or d.sensors]
    named = [f"{meter}.high" in causes(d) for meter, d in wrong]
    astray = [bool(causes(d)) and f"{meter}.high" not in causes(d) for meter, d in wrong]
    behind = [calibrated(case) for case in sound]
    later = [bool(d.findings or d.sensors) for d in behind if d]
    return {
        "refused": {"count": behind.count(None), "of": len(behind)},
        "later": {"count": sum(later), "of": len(later)},
        "alarms": {"count": len(alarmed), "of": len(sound)},
        "blamed": {"count": sum(map(blames_a_meter, other)), "of": len(other)},
        "named": {"count": sum(named), "of": len(wrong)},
        "astray": {"count": sum(astray), "of": len(wrong)},
    }


if __name__ == "__main__":
    print(json.dumps(figures()))
