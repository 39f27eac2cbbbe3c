"""`rulec check`: what a recording is good for, what is doubted, and what programs are told."""

import functools
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.commands.recording_facts import Facts, facts_of, sought_of
from rulec.effects.model_builder import open_builder
from tests.conftest import ROOT, Capsys, Patch
from tests.written import write_columns

ABC, TANKS = ROOT / "plants" / "abc", ROOT / "plants" / "cascaded-tanks"
HEALTHY = ABC / "examples" / "healthy.csv"


@functools.cache
def loaded(plant: Path) -> Any:
    return open_builder(plant)


def facts(recording: Path, plant: Path = ABC) -> Facts:
    ruleset, builder = loaded(plant)
    return facts_of(recording, ruleset, sought_of(builder.matches))


def without(folder: Path, title: str) -> Path:
    """The healthy recording of abc without a column."""
    file = folder / "recording.csv"
    pd.read_csv(HEALTHY).drop(columns=title).to_csv(file, index=False)
    return file


def odd(found: Facts) -> dict[str, list[str]]:
    return {r["signal"]: r["odd"] for r in found["readings"] if r["odd"]}


def test_whole_recording_runs_everything() -> None:
    found = facts(HEALTHY)
    assert odd(found) == {}
    assert found["lacks"] == found["blind"] == found["strangers"] == []
    for key in ("estimates", "comparisons", "faults", "effects"):
        runs, every = found[key]
        assert runs == every > 0
    assert found["settled"] > 0.5
    assert {r["signal"]: r["title"] for r in found["readings"]}["A.dp"] == "A.dp [bar]"
    assert "viscosity" in found["unread"]


def test_missing_column_is_told_with_what_waits_for_it(tmp_path: Path) -> None:
    """Estimates and comparisons that cannot run, and faults that nothing would show; of a driver
    the effects. A plant that stores needs what its balances compare: inputs alone show nothing."""
    found = facts(without(tmp_path, "A.P_el [W]"))
    (power,) = found["lacks"]
    assert (power["signal"], power["estimates"]) == ("A.P_el", ["A.power"])
    assert len(power["comparisons"]) == found["comparisons"][1] - found["comparisons"][0]
    assert {"A.power-plant", "A.power-pump"} < set(power["comparisons"])
    assert {"A.P_el.high", "A.P_el.low"} <= set(found["blind"])
    assert len(found["blind"]) == found["faults"][1] - found["faults"][0]
    found = facts(without(tmp_path, "A.T [degC]"))
    (warm,) = found["lacks"]
    assert warm["signal"] == "A.T"
    assert "slip-temperature" in warm["effects"]
    assert not warm["estimates"]
    assert found["effects"][0] < found["effects"][1]
    stored = TANKS / "examples" / "inputs.csv"
    assert facts(stored, TANKS)["faults"][0] == facts(stored, TANKS)["effects"][0] == 0
    assert main(["check", str(TANKS), str(stored)]) == 1


def test_command_tells_files_and_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "130")
    file = without(tmp_path, "A.P_el [W]")
    assert main(["check", str(ABC), str(file)]) == 0
    out = capsys.readouterr().out
    assert f"{ABC}: no mistakes" in out
    assert "without A.P_el (not in the recording): no A.power" in out
    assert main(["check", str(ABC), str(file), "--format", "json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert output["found"] == []
    assert output["recordings"][str(file)]["lacks"][0]["signal"] == "A.P_el"


def test_what_a_reading_does_again_and_again_is_told_once(tmp_path: Path) -> None:
    """Two times above its range: the first is told, the other is counted."""
    values = pd.read_csv(HEALTHY)
    values.loc[[*range(10, 20), *range(40, 50)], "A.dp [bar]"] = 90.0
    values.to_csv(tmp_path / "r.csv", index=False)
    (text,) = odd(facts(tmp_path / "r.csv"))["A.dp"]
    assert re.fullmatch(r"A\.dp reads 90 bar, above its range .*; 1 time more", text)


def test_doubts_are_told_beside_a_recording(tmp_path: Path, capsys: Capsys) -> None:
    """What `check PLANT` doubts, `check PLANT RECORDING` doubts as well."""
    folder = shutil.copytree(ROOT / "tests" / "errors" / "KB146-meter-read-twice", tmp_path / "p")
    columns = {"time [s]": np.arange(60), "FI-104": np.full(60, 5.0)}
    file = write_columns(tmp_path / "r.csv", columns)
    main(["check", str(folder), str(file)])
    out = capsys.readouterr().out
    assert "'FI-104' is P.Q and also V.Q" in out
    assert "1 warning in 1 file" in out


def test_doubts_and_mistakes_in_sarif(tmp_path: Path, capsys: Capsys, monkeypatch: Patch) -> None:
    """Doubts are told where there is no mistake, and a program may tell them apart. A log as
    the standard asks for has both places of a clash, by relative paths."""
    folder = shutil.copytree(ROOT / "tests" / "errors" / "KB141-apart", tmp_path / "p")
    assert main(["check", str(folder)]) == 0
    assert "1 warning in 1 file" in capsys.readouterr().out
    assert main(["check", str(folder), "--format", "sarif"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["runs"][0]["results"]
    assert (result["ruleId"], result["level"]) == ("KB141", "warning")
    text = (folder / "plant.yaml").read_text(encoding="utf-8")
    (folder / "plant.yaml").write_text(text.replace("static-mixer", "static-mixr"))
    assert ["KB070"] == [d.code for d in collect([folder])]
    monkeypatch.chdir(ROOT)
    assert main(["check", "tests/errors/KB030-twins", "--format", "sarif"]) == 1
    log = json.loads(capsys.readouterr().out)
    assert log["version"] == "2.1.0"
    (run,) = log["runs"]
    assert run["tool"]["driver"]["name"] == "rulec"
    (result,) = run["results"]
    assert result["level"] == "error"
    locations = [
        part["physicalLocation"]["artifactLocation"]["uri"]
        for part in (*result["locations"], *result["relatedLocations"])
    ]
    assert locations == ["tests/errors/KB030-twins/module.yaml", "kb/modules/static-mixer.yaml"]
    region = result["locations"][0]["physicalLocation"]["region"]
    assert region == {"startLine": 1, "startColumn": 9, "endColumn": 21}
