"""Boiler branch of a district heating test facility: from data sheets to a repaired plant.

`python -m tests.rig.rse` prints what `rulec mismatch` told on each shared day, and the error of the
plant adopted from the longer day on the shorter one.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import yaml

from tests.conftest import ROOT, recordings_folder
from tests.rig.mismatch.ask import Answer, Failed, adopt, ask, simulate
from tests.rig.mismatch.case import Case, copy_plant
from tests.rig.mismatch.measure import numbers, rms

FOLDER, PLANT = "rse-district-heating", "rse-boiler"
SHORTER, LONGER = "0412_Test1", "0412_Test2"
FLOW = "FT101 [m3/h]"
OFF = 1.0
"""m3/h; below it the branch is off."""

VALVE = "equal-percentage"
PUMP, RESISTANCES = ("h0", "h1", "h2"), ("k", "Kv")


def day_file(folder: Path, day: str) -> Path:
    """Recording of a day."""
    return folder / f"{day}.csv.gz"


def asked(folder: Path, day: str, work: Path) -> Answer:
    """`rulec mismatch` of the plant as shipped, from its sheets, on one day."""
    file = day_file(folder, day)
    return ask(Case(day, copy_plant(PLANT, work), file, file), work)


def valve_probability(answer: Answer) -> float:
    """Of the class whose likeliest member is the valve's characteristic; 0 where it is not told."""
    found = (e for e in answer.form["effects"] if e["effect"] == VALVE)
    return max((float(e["class_probability"]) for e in found), default=0.0)


def strained(answer: Answer) -> dict[str, float]:
    """Parameters that are told to be off their sheet, with their distance in u."""
    return {
        s["parameter"].partition(".")[2]: float(s["distance"])
        for s in answer.form.get("strain", ())
    }


def values(plant: Path, file: str = "calibration.yaml") -> dict[str, dict[str, float]]:
    """Parameters of the branch with value and u, from the plant file or its calibration."""
    modules = yaml.safe_load((plant / file).read_text(encoding="utf-8"))["modules"]
    found: dict[str, dict[str, float]] = modules["boiler"]["parameters"]
    return found


def distances(adopted: Path) -> dict[str, float]:
    """How far each parameter of the pump is from its sheet, in u of the sheet."""
    found, sheet = values(adopted), values(ROOT / "plants" / PLANT, "plant.yaml")
    return {p: abs(found[p]["value"] - sheet[p]["value"]) / sheet[p]["u"] for p in PUMP}


def error_on(plant: Path, recording: Path, target: Path) -> float:
    """Error of the simulated flow while the branch runs, m3/h, root mean square."""
    simulate(plant, recording, target)
    measured = numbers(recording, FLOW)
    return rms((numbers(target, FLOW) - measured)[measured >= OFF])


def _print(folder: Path, work: Path) -> None:
    for day in (SHORTER, LONGER):
        answer = asked(folder, day, work)
        told = f"{answer.verdict}, valve {valve_probability(answer):.3f}"
        print(f"{day}: {told}, off the sheet {strained(answer)} u")
        try:
            adopted = adopt(answer)
        except Failed as refused:
            print(f"  not adopted: {refused}")
            continue
        print("  adopted:", {name: p["value"] for name, p in values(adopted).items()})
        error = error_on(adopted, day_file(folder, SHORTER), work / "simulated.csv")
        print(f"  pump off the sheet by {distances(adopted)} u; {error:.3f} m3/h on {SHORTER}")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        _print(recordings_folder() / FOLDER, Path(temporary))
