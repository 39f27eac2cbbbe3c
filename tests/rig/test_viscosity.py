"""The ZeMA rig with the viscosity of a mineral oil in the pump law, against a fitted exponential.

Which oil was in the rig is not known; HLP 46 is assumed, and its two points are not fitted.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from rulec.cli import main
from tests.conftest import ROOT, recordings_folder
from tests.rig.zema import Cycle, read_cycles, score, write_cycles

KINDS = {"viscosity": "pump-set-oil", "exponential": "pump-set-warm"}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Cycle], set[int]]:
    """A folder with the commissioning cycles, all cycles, and the blocks of commissioning."""
    source = recordings_folder() / "zema-hydraulic"
    if not source.is_dir():
        pytest.skip(f"no real recordings at {source} (set RULEC_RECORDINGS)")
    folder, cycles = tmp_path_factory.mktemp("rig"), read_cycles(source)
    healthy = [c for c in cycles if c.leakage == 0 and c.settled]
    blocks = set(sorted({c.block for c in healthy})[::3])
    write_cycles(source, {c.number for c in healthy if c.block in blocks}, folder / "leak-free.csv")
    write_cycles(source, {c.number for c in cycles if c.block not in blocks}, folder / "unseen.csv")
    shutil.copy(ROOT / "plants" / "zema-hydraulic" / "columns.yaml", folder)
    return folder, cycles, blocks


@pytest.fixture(scope="module")
def misfits(rig: tuple[Path, list[Cycle], set[int]]) -> Mapping[str, float]:
    """Misfit of the pump's law after calibration, l/h, for both laws; leaves their plants."""
    found = {}
    for name, kind in KINDS.items():
        plant, target = rig[0] / f"{name}.yaml", rig[0] / f"{name}.json"
        lines = ["plant: rig", "title: rig", "fluid: hydraulic-oil-46", f"kb: {ROOT / 'kb'}"]
        lines += ["columns: columns.yaml", f"modules: {{main: {{type: {kind}}}}}"]
        plant.write_text("\n".join(lines) + "\n", encoding="utf-8")
        _call("calibrate", plant, rig[0] / "leak-free.csv", "-o", f"{plant}.found", target)
        with plant.open("a", encoding="utf-8") as out:
            out.write(f"calibration: [{name}.yaml.found]\n")
        data: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
        found[name] = data["modules"]["main"]["misfit"]["pump"]["value"]
    return found


def _call(command: str, *arguments: object) -> None:
    *rest, target = (str(a) for a in arguments)
    assert main([command, *rest, "--json", target]) == 0


@pytest.mark.prove
def test_viscosity_explains_the_flow_better(misfits: Mapping[str, float]) -> None:
    """With as many parameters, a laminar share of the slip fits better than an exponential."""
    assert misfits["viscosity"] < misfits["exponential"]


@pytest.mark.prove
def test_diagnosis_with_viscosity(
    rig: tuple[Path, list[Cycle], set[int]], misfits: Mapping[str, float]
) -> None:
    """Unseen blocks: no healthy cycle alarms, leakage is named in all severe and 99 % of weak."""
    folder, cycles, blocks = rig
    target = folder / "diagnosis.json"
    _call("diagnose", folder / "viscosity.yaml", folder / "unseen.csv", target)
    result = score(json.loads(target.read_text(encoding="utf-8")), cycles, blocks)
    count = {
        word: [sum(n for k, n in t.items() if k.startswith(word)) for t in tables]
        for word in ("none", "weak", "severe")
        for tables in [(result.cycles, result.alarmed, result.leak_named)]
    }
    assert 0 == count["none"][1]
    assert count["severe"][0] == count["severe"][2]
    assert count["weak"][2] >= 0.99 * count["weak"][0]
