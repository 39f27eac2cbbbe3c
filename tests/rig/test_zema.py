"""The ZeMA rig: commissioning on some blocks, diagnosis of the others, against the labels."""

import functools
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from rulec.cli import main
from tests.conftest import ROOT
from tests.rig import real
from tests.rig.zema import Judged, by_label, read_cycles, run, score, split

FOLDER = "zema-hydraulic"
KINDS = {"viscosity": "pump-set-oil", "exponential": "pump-set-warm"}
"""Laws of the pump with the viscosity of a mineral oil, or with a fitted exponential. Which oil was
in the rig is not known; HLP 46 is assumed, and its two points are not fitted."""


@functools.cache
def scored(law: str) -> list[Judged]:
    """Unseen blocks by a pump law."""
    return run(real(FOLDER), law)


def test_unseen_blocks() -> None:
    """Not one of 907 leak-free cycles raises an alarm. Severe leakage is found in every cycle, with
    leakage among the causes, weak leakage (3 % of the flow) in at least 99 %. The degree orders
    none < weak < severe, without overlap in settled cycles. Where something else acts on the
    working pressure the tool says so and names no fault."""
    warm = scored("with temperature")
    cycles = by_label(warm)
    assert 907 == len(cycles["healthy"])
    found_as_labelled(cycles)
    none, weak, severe = (
        [j.degree for j in own if j.cycle.settled and not j.cycle.off_profile]
        for own in cycles.values()
    )
    assert 0.0 == max(none)
    assert 0.0 < min(weak) <= max(weak) < min(severe)
    off = [j for j in warm if j.cycle.off_profile]
    assert all(j.unknown and not j.named_off for j in off)


def found_as_labelled(cycles: dict[str, list[Judged]]) -> None:
    assert not any(j.alarmed for j in cycles["healthy"])
    assert all(j.leaks for j in cycles["severe"])
    assert sum(j.leaks for j in cycles["weak"]) >= 0.99 * len(cycles["weak"])


@pytest.mark.prove
def test_temperature_in_the_pump_law_pays() -> None:
    """Without oil temperature half of the weak leakages are lost; still no false alarm."""
    warm, cold = (by_label(scored(f"{word} temperature")) for word in ("with", "without"))
    assert not any(j.alarmed for j in cold["healthy"])
    assert sum(j.leaks for j in cold["weak"]) < 0.6 * sum(j.leaks for j in warm["weak"])


@pytest.mark.prove
def test_viscosity_explains_the_flow_better(tmp_path: Path) -> None:
    """With as many parameters, a laminar share of the slip fits better than an exponential. With it
    no healthy cycle of unseen blocks alarms, leakage is named in all severe and 99 % of weak."""
    source = real(FOLDER)
    cycles = read_cycles(source)
    blocks = split(source, cycles, tmp_path)
    shutil.copy(ROOT / "plants" / "zema-hydraulic" / "columns.yaml", tmp_path)
    misfits = {}
    for name, kind in KINDS.items():
        plant = tmp_path / f"{name}.yaml"
        lines = ["plant: rig", "title: rig", "fluid: hydraulic-oil-46", f"kb: {ROOT / 'kb'}"]
        lines += ["columns: columns.yaml", f"modules: {{main: {{type: {kind}}}}}"]
        plant.write_text("\n".join(lines) + "\n", encoding="utf-8")
        data = asked("calibrate", plant, tmp_path / "commissioning.csv", "-o", f"{plant}.found")
        with plant.open("a", encoding="utf-8") as out:
            out.write(f"calibration: [{name}.yaml.found]\n")
        misfits[name] = data["modules"]["main"]["misfit"]["pump"]["value"]
    assert misfits["viscosity"] < misfits["exponential"]
    answer = asked("diagnose", tmp_path / "viscosity.yaml", tmp_path / "unseen.csv")
    found_as_labelled(by_label(score(answer, cycles, blocks)))


def asked(command: str, plant: Path, *arguments: object) -> Any:
    """What a command gives as JSON."""
    target = plant.with_suffix(".json")
    assert main([command, str(plant), *map(str, arguments), "--json", str(target)]) == 0
    return json.loads(target.read_text(encoding="utf-8"))


def test_labels_are_not_read_by_the_tool() -> None:
    """No product file speaks of the label file."""
    for folder in ("rulec", "runtime", "plants", "kb"):
        for file in (ROOT / folder).rglob("*.*"):
            if file.suffix in (".py", ".yaml"):
                assert "conditions.csv" not in file.read_text(encoding="utf-8"), file
