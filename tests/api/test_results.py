"""Results: frozen, the machine form of the command, tables, stories, errors."""

import functools
import json
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import rulec
from rulec.cli import main
from rulec.commands import result
from tests.conftest import ROOT, SOURCES, Capsys
from tests.written import json_of, read_columns

ABC = ROOT / "plants" / "abc"
EXAMPLES = ABC / "examples"
LEAKAGE = EXAMPLES / "leakage_A.csv"


@functools.cache
def plant() -> rulec.CompileResult:
    return rulec.compile(ABC)


@functools.cache
def found() -> rulec.DiagnoseResult:
    return rulec.diagnose(plant(), LEAKAGE)


@functools.cache
def explained() -> rulec.MismatchResult:
    """Of a recording in memory with which nothing is wrong."""
    return rulec.mismatch(plant(), pd.read_csv(EXAMPLES / "healthy.csv"))


def test_data_are_those_of_the_command(tmp_path: Path) -> None:
    """Diagnosis, calibration, and what is predicted in place of readings, value by value."""
    assert found().to_dict() == json_of("diagnose", ABC, LEAKAGE)
    file = EXAMPLES / "calibration.csv"
    fitted = rulec.calibrate(ABC, file)
    written = tmp_path / "calibration.yaml"
    assert fitted.to_dict() == json_of("calibrate", ABC, file, "-o", written)
    assert fitted.text == written.read_text(encoding="utf-8")
    predicted = rulec.simulate(plant(), LEAKAGE, faults=["A.leakage=0.3"]).columns()
    words = ("simulate", ABC, LEAKAGE, "-o", tmp_path / "s.csv", "--fault", "A.leakage=0.3")
    assert 0 == main([*map(str, words)])
    for title, column in read_columns(tmp_path / "s.csv").items():
        assert column == pytest.approx(predicted[title], rel=1e-5), title
    assert "A: the pump delivers 60 % less than its characteristic predicts" in str(found())


def test_tables_are_frames_of_any_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first library that is installed; what was not asked for is told."""
    kinds = {"pandas": pd.DataFrame, "polars": pl.DataFrame, "pyarrow": pa.Table}
    for name, kind in kinds.items():
        table = found().to_frame(backend=name)  # type: ignore[arg-type]
        assert isinstance(table, kind)
        assert ["A.leakage"] * 3 == list(table["fault"].to_numpy())
    assert 80 == len(found().to_frame("samples"))
    with pytest.raises(rulec.Misused, match="table 'x': give one of findings, samples"):
        found().to_frame("x")
    with pytest.raises(rulec.Misused, match="give one of pandas, polars, pyarrow"):
        found().to_frame(backend="excel")  # type: ignore[arg-type]
    monkeypatch.setattr(result, "find_spec", lambda name: None)
    with pytest.raises(rulec.FrameRefused, match="needs pandas or polars or pyarrow"):
        found().to_frame()


def test_a_repair_in_memory_is_adopted(tmp_path: Path) -> None:
    """Nothing was found, so values alone; from its file it cannot be, as the readings are gone."""
    result = explained()
    with pytest.raises(rulec.AdoptRefused, match="--recalibrated writes the plant with"):
        rulec.adopt(result, tmp_path / "repaired")
    adopted = rulec.adopt(result, tmp_path / "repaired", recalibrated=True)
    assert "abc" == rulec.compile(adopted.plant).ruleset.plant
    assert adopted.to_frame(backend="pyarrow").num_rows == len(result.found.fits)
    assert "ready to use as PLANT" in " ".join(str(adopted).split())
    with pytest.raises(rulec.AdoptRefused, match="is not empty"):
        rulec.adopt(result, tmp_path / "repaired", recalibrated=True)
    file = tmp_path / "found.json"
    file.write_text(json.dumps(result.to_dict()), encoding="utf-8")
    with pytest.raises(rulec.AdoptRefused, match="a recording was in memory"):
        rulec.adopt(file, tmp_path / "again", recalibrated=True)
    planned = rulec.experiment(result, steps=3).to_dict()
    assert [True] * 3 == [step["covers"] for step in planned["steps"]]


def test_mistakes_raise_what_the_command_says(tmp_path: Path, capsys: Capsys) -> None:
    """Of YAML: every mistake with its place, not the end of the process."""
    (tmp_path / "plant.yaml").write_text("plant: x\n", encoding="utf-8")
    with pytest.raises(rulec.Refused) as refused:
        rulec.compile(tmp_path)
    assert 1 == main(["compile", str(tmp_path)])
    assert f"{refused.value}\n" == capsys.readouterr().err
    with pytest.raises(rulec.Misused, match="give the plant's folder"):
        rulec.mismatch("abc.ruleset.json", LEAKAGE)
    with pytest.raises(rulec.Misused, match="--fault leak: write <module>"):
        rulec.simulate(plant(), LEAKAGE, faults=["leak"])
    with pytest.raises(rulec.SimulationRefused):
        rulec.simulate(plant(), LEAKAGE, faults=["A.leek=0.1"])
    with pytest.raises(rulec.CalibrationRefused):
        rulec.calibrate(ABC, EXAMPLES / "healthy.csv")


def test_importing_loads_nothing() -> None:
    """Neither numpy nor rich; and the function `mismatch` stays one when its package is loaded."""
    program = (
        "import sys, rulec\n"
        "assert not {'numpy', 'rich', 'sympy', 'yaml', 'narwhals'} & set(sys.modules)\n"
        "from rulec.mismatch.result import MismatchRefused\n"
        "import rulec.mismatch.answer\n"
        "assert callable(rulec.mismatch) and rulec.MismatchRefused is MismatchRefused\n"
        "assert set(rulec.__all__) <= set(dir(rulec))\n"
        "assert all(callable(getattr(rulec, name)) for name in rulec.__all__)\n"
    )
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)
