"""Each fault of kb/ on recordings of the independent truth: what must be said, and what not."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.recordings.recording import read_recording

from rulec.passes.pipeline import compile_plant
from tests.dosing import RIGS, fault_replay, record, write_csv
from tests.written import write_exact, write_plant

FOLDER = Path(__file__).parent / "faults"
TYPES = ("dosing-pcp", "dosing-membrane", "dosing-centrifugal")
PUMPS = dict(zip(("abc", "abc-membrane", "abc-centrifugal"), TYPES, strict=True))
SEED = 7


def _cases() -> Iterator[Any]:
    for file in sorted(FOLDER.glob("*.yaml")):
        for case in yaml.safe_load(file.read_text(encoding="utf-8"))["cases"]:
            yield pytest.param(case, id=f"{file.stem}: {case['title']}")


def _diagnosed(given: dict[str, Any], folder: Path) -> Diagnosis:
    """Simulate the fault, compile the plant of the same modules, diagnose."""
    run = fault_replay(RIGS[given["rig"]], given["fault"], degrees=(0.0, given["degree"]))
    write_csv(folder / "recording.csv", record(run, seed=SEED).readings)
    types = {"A": PUMPS[given["rig"]], "B": "dosing-pcp", "C": "static-mixer"}
    ruleset = compile_plant(write_exact(write_plant(folder, types, "A -> C, B -> C")))
    return diagnose(read_recording(folder / "recording.csv", ruleset), ruleset)


@pytest.mark.parametrize("case", list(_cases()))
def test_case(case: dict[str, Any], tmp_path: Path) -> None:
    """Given a fault, expect the finding and none of the excluded ones."""
    expect, found = case["expect"], _diagnosed(case["given"], tmp_path).findings
    if not expect:
        assert [] == [f.fault.id for f in found]
        return
    (finding,) = found
    named = [finding.fault.id, *(name for name, _ in finding.alternatives)]
    wanted = expect.get("fault") or expect["among"]
    assert wanted in (named[:1] if "fault" in expect else named)
    assert not set(named) & set(case.get("expect_not", ()))
    if finding.fault.id == wanted:
        assert case["given"]["degree"] == pytest.approx(finding.degree, abs=expect["within"])
