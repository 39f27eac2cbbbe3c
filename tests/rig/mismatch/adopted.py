"""Is what was told what is adopted? `python -m tests.rig.mismatch.adopted [RIG ...]`.

Each shared recording is asked about as a user would; the plants are written with `rulec adopt` and
simulated with `rulec simulate`. Compared are errors on the held-out spans, as told and as found in
the simulated files, and those on a part of the recording that the tool never saw, where there is
one. All rows with a reading and a prediction by all plants count; in plants that store nothing the
told errors are those of settled points, so rows between them make a difference.
"""

from __future__ import annotations

import argparse
import csv
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, recordings_folder
from tests.rig.mismatch import esp, hsy, zema
from tests.rig.mismatch.ask import Answer, Failed, ask, call
from tests.rig.mismatch.case import Case, Row, copy_plant, copy_rows, read_columns

PLANTS = Path(__file__).parent.parent / "plants"
MODELS = ("recalibrated", "repaired")
KEPT_BACK = 0.7
"""Share of each state of the pipeline that is shown to the tool."""


@dataclass(frozen=True)
class Compared:
    """Errors of one reading, as told and as simulated, in its unit; NaN where there is none."""

    case: str
    verdict: str
    signal: str
    told: Mapping[str, float]
    heldout: Mapping[str, float]
    unseen: Mapping[str, float]
    written: str

    @property
    def ratio(self) -> float:
        """Adopted over recalibrated on what was not seen: 1 where nothing is adopted."""
        there = self.unseen if np.isfinite(self.unseen["recalibrated"]) else self.heldout
        own = there["repaired"] if self.written == "repaired" else there["recalibrated"]
        return own / there["recalibrated"]


def rig_plant(name: str, work: Path) -> Path:
    """A plant of this folder, with the knowledge base and its own types in a folder below it."""
    kb, place = work / "rig-kb", work / f"rig-{name}"
    if not kb.exists():
        shutil.copytree(ROOT / "kb", kb)
        shutil.copytree(PLANTS / "types", kb / "rigs" / "types")
    if not place.exists():
        shutil.copytree(PLANTS / name, place)
        plant = place / "plant.yaml"
        plant.write_text(f"{plant.read_text(encoding='utf-8').rstrip()}\nkb: {kb}\n")
    return place / "plant.yaml"


def _tanks(folder: Path, work: Path) -> list[Case]:
    plant, file = copy_plant("cascaded-tanks", work), folder / "cascaded-tanks" / "estimation.csv"
    return [Case("cascaded tanks", plant, file, file)]


def _two_tanks(folder: Path, work: Path) -> list[Case]:
    file = folder / "wigren-two-tanks" / "estimation.csv"
    return [Case("two tanks", rig_plant("two-tanks", work), file, file)]


def _lab(folder: Path, work: Path) -> list[Case]:
    plant, lab = copy_plant("wastewater-lab", work), folder / "aau-wastewater-lab"
    return [
        Case(f"waste-water lab {f.name[:5]}", plant, f, f) for f in sorted(lab.glob("*.csv.gz"))
    ]


def _pipeline(folder: Path, work: Path) -> list[Case]:
    """The end of each state is not shown."""
    source = folder / "whut-pipeline" / "recording.csv"
    states = [row[0] for row in read_columns(source, "pumps [1]")]
    total = {s: states.count(s) for s in set(states)}

    def early() -> Callable[[Row], bool]:
        seen: dict[str, int] = {}

        def wanted(row: Row) -> bool:
            state = row["pumps [1]"]
            seen[state] = seen.get(state, 0) + 1
            return seen[state] <= KEPT_BACK * total[state]

        return wanted

    shown, unseen, first = work / "pipe-shown.csv", work / "pipe-unseen.csv", early()
    copy_rows(source, shown, first)
    second = early()
    copy_rows(source, unseen, lambda row: not second(row))
    return [Case("pipeline", rig_plant("pipeline", work), shown, unseen)]


def _pump_loop(folder: Path, work: Path) -> list[Case]:
    """Speeds 700 and 1200 are shown, 1000 is not; calibrated with the valve open."""
    lab, plant = folder / "pump-suction-throttling", rig_plant("pump-loop", work)
    files = {f.stem: f for f in sorted(lab.glob("*.csv"))}
    shown, unseen, water = (work / f"loop-{p}.csv" for p in ("shown", "unseen", "open"))
    _loop_rows([f for n, f in files.items() if not n.startswith("n1000")], shown)
    _loop_rows([f for n, f in files.items() if n.startswith("n1000")], unseen)
    _loop_rows([f for n, f in files.items() if n.endswith("v000") and "n1000" not in n], water)
    calibration = plant.parent / "calibration.yaml"
    if not calibration.exists():
        call("calibrate", plant, water, "-o", calibration)
        text = plant.read_text(encoding="utf-8")
        plant.write_text(f"{text}calibration: [calibration.yaml]\n", encoding="utf-8")
    return [Case("pump loop", plant, shown, unseen)]


def _loop_rows(files: Sequence[Path], target: Path) -> None:
    """The pump's readings: its head is the difference of two gauge pressures."""
    titles = ("time [s]", "RT01 [rpm]", "FT01 [m3/h]", "PT02 [bar]", "PT04 [bar]", "TT01 [degC]")
    rows = [[float(c) for c in row] for f in files for row in read_columns(f, *titles)]
    with target.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        head = ["time [s]", "pump.n [rpm]", "pump.Q [m3/h]", "pump.dp [bar]", "pump.p_s [bar]"]
        writer.writerow([*head, "pump.T [degC]"])
        for t, n, flow, before, behind, warm in sorted(rows):
            writer.writerow([t, n, flow, round(behind - before, 6), before, warm])


def _zema(folder: Path, work: Path) -> list[Case]:
    shown = zema.prepare(folder, work)[0]
    whole = folder / zema.FOLDER / zema.RECORDING
    every = replace(shown, name="zema all cycles", analysis=whole, unseen=whole)
    return [shown, every]


RIGS: dict[str, Callable[[Path, Path], list[Case]]] = {
    "tanks": _tanks,
    "two-tanks": _two_tanks,
    "lab": _lab,
    "pipeline": _pipeline,
    "pump-loop": _pump_loop,
    "zema": _zema,
    "esp": esp.prepare,
    "hsy": hsy.prepare,
}


def compared(case: Case, work: Path) -> Compared:
    """Ask, write both plants, simulate, and compare."""
    name = case.name.replace(" ", "-")
    file = work / f"{name}.mismatch.json"
    answer = Answer(_form(file), file, 0.0) if file.exists() else ask(case, work)
    fit = answer.form["fit"]
    plants = {}
    written = "nothing"
    for model, flags in (("recalibrated", ["--recalibrated"]), ("repaired", [])):
        target = work / f"{name}.{model}"
        try:
            if not target.exists():
                call("adopt", answer.file, "-o", target, *flags)
            plants[model], written = target, model
        except Failed as failure:
            print(f"{case.name}: {model}: {failure}")
    spans = answer.form["split"]["heldout"]
    found = _errors(case.plant, plants, case.analysis, fit["signal"], spans)
    nothing = dict.fromkeys(MODELS, float("nan"))
    unseen = nothing
    if case.unseen != case.analysis:
        unseen = _errors(case.plant, plants, case.unseen, fit["signal"], None)
    told = {m: fit["heldout"][m] for m in MODELS}
    return Compared(case.name, answer.verdict, fit["signal"], told, found, unseen, written)


def _form(file: Path) -> Mapping[str, object]:
    import json

    form: Mapping[str, object] = json.loads(file.read_text(encoding="utf-8"))
    return form


def _errors(
    shipped: Path,
    plants: Mapping[str, Path],
    recording: Path,
    signal: str,
    spans: Sequence[Sequence[float]] | None,
) -> dict[str, float]:
    """Errors of the plants over rows that all of them predict, as `rulec simulate` writes them."""
    rules = compile_plant(shipped)
    measured = read_recording(recording, rules)
    off = {}
    with tempfile.TemporaryDirectory() as folder:
        for model, plant in plants.items():
            target = Path(folder) / "simulated.csv"
            call("simulate", plant, recording, "-o", target)
            off[model] = _off(rules, read_recording(target, rules), measured, signal)
    known = np.all([np.isfinite(o) for o in off.values()], axis=0)
    if spans is not None:
        time = measured.time
        known &= np.any([(time >= a) & (time <= b) for a, b in spans], axis=0)
    return {m: float(np.sqrt(np.mean(off[m][known] ** 2))) if m in off else np.nan for m in MODELS}


def _off(rules: Ruleset, simulated: Recording, measured: Recording, signal: str) -> np.ndarray:
    """Simulated less measured, as shown."""
    spec = rules.signal_by_id[signal]
    at = np.searchsorted(simulated.time, measured.time)
    off: np.ndarray = (simulated.values[signal][at] - measured.values[signal]) / spec.factor
    low = -np.inf if spec.minimum is None else spec.minimum
    return np.where(measured.values[signal] >= low, off, np.nan)


def line(found: Compared) -> str:
    """One row of the table: recalibrated / repaired."""

    def pair(errors: Mapping[str, float]) -> str:
        return " / ".join(f"{errors[m]:.4g}" if errors[m] is not None else "-" for m in MODELS)

    return (
        f"{found.case:28} {found.verdict:10} {found.signal:10} told {pair(found.told):18} "
        f"simulated {pair(found.heldout):18} unseen {pair(found.unseen):18} "
        f"wrote {found.written:12} ratio {found.ratio:.3f}"
    )


def main() -> None:
    """Print a line for each recording."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rigs", nargs="*", metavar="RIG", help=", ".join(RIGS))
    parser.add_argument("--keep", metavar="FOLDER", type=Path, help="leave all files there")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work: Path = options.keep or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        for rig in options.rigs or RIGS:
            for case in RIGS[rig](recordings_folder(), work):
                try:
                    print(line(compared(case, work)), flush=True)
                except Failed as failure:
                    print(f"{case.name}: {failure}", flush=True)


if __name__ == "__main__":
    main()
