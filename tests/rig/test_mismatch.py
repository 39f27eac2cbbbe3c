"""The acceptance of `rulec mismatch`: what the tool is shown, and how answers are scored."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from tests.conftest import recordings_folder
from tests.rig.mismatch import ask, esp, hsy, speed, zema
from tests.rig.mismatch.ask import Answer
from tests.rig.mismatch.case import Case, read_columns
from tests.rig.mismatch.measure import hits, likeness, numbers, rms
from tests.rig.mismatch.show import show_answers
from tests.rig.zema import read_cycles

FORM: dict[str, Any] = {
    "plant": "rig",
    "recording": "rig.csv",
    "verdict": "named",
    "locations": [
        {
            "module": "main",
            "place": "law",
            "share": 0.9,
            "region": [{"variable": "main.T", "from": 50, "to": None, "unit": "degC"}],
            "periods": [[600, 720]],
        }
    ],
    "effects": [
        {
            "effect": "some-effect",
            "module": "main",
            "place": "law",
            "parameters": {"b": {"value": 0.01, "u": 0.001, "unit": "1/K"}},
            "equation": "law",
            "text": "text",
            "probability": 0.9,
            "alternatives": [{"effect": "another", "probability": 0.1}],
            "periods": [{"since": 60, "until": 180, "degree": 0.03, "u": 0.01}],
        }
    ],
    "fit": {
        "signal": "main.Q",
        "unit": "l/min",
        "estimation": {"shipped": 0.08, "recalibrated": 0.07, "repaired": 0.02},
        "heldout": {
            "shipped": 0.08,
            "recalibrated": 0.07,
            "repaired": 0.02,
            "noise": 0.004,
            "gain_interval": [0.6, 0.8],
        },
        "closed": 0.93,
    },
    "confounded": [],
    "hidden_driver": None,
    "next": "",
    "seconds": 3.0,
}
"""An answer in the machine form."""


@pytest.fixture(scope="module")
def folder() -> Path:
    """Folder of the real recordings."""
    found = recordings_folder()
    if not found.is_dir():
        pytest.skip(f"no real recordings at {found} (set RULEC_RECORDINGS)")
    return found


def _column(file: Path, title: str) -> set[str]:
    return {cell for (cell,) in read_columns(file, title)}


def _header(file: Path) -> list[str]:
    with file.open(encoding="utf-8") as source:
        return source.readline().strip().split(",")


def test_zema_is_shown_half_of_the_blocks(folder: Path, tmp_path: Path) -> None:
    """No cycle is shown and judged; variants leave out leaking cycles or columns."""
    cases = {c.name: c for c in zema.prepare(folder, tmp_path)}
    cycles = {str(c.number): c for c in read_cycles(folder / zema.FOLDER)}
    full, healthy, usual = (cases[f"zema {n}"] for n in ("full", "leak-free", "on profile"))
    shown, unseen = _column(full.analysis, "cycle"), _column(full.unseen, "cycle")
    assert set() == shown & unseen
    assert set(cycles) == shown | unseen
    assert {0} == {cycles[c].leakage for c in _column(healthy.analysis, "cycle")}
    assert {()} == {cycles[c].off_profile for c in _column(usual.analysis, "cycle")}
    for name, gone in (("temperatures", zema.TEMPERATURES), ("flow meter", (zema.FLOW,))):
        header = _header(cases[f"zema on profile without {name}"].analysis)
        assert set(_header(usual.analysis)) - set(header) == set(gone)


def test_labels_are_not_shown(folder: Path, tmp_path: Path) -> None:
    """What the experimenters set is in no recording of the cases."""
    labels = {"cooler_pct", "valve_pct", "pump_leakage", "accumulator_bar", "stable_flag", "block"}
    for case in zema.prepare(folder, tmp_path):
        assert set() == labels & set(_header(case.analysis))


def test_hsy_is_shown_every_second_day(folder: Path, tmp_path: Path) -> None:
    """Eight days are shown, eight judge."""
    (case,) = hsy.prepare(folder, tmp_path)
    days = [{t[:10] for t in _column(file, "time")} for file in (case.analysis, case.unseen)]
    assert [8, 8] == [len(part) for part in days]
    assert set() == days[0] & days[1]


def test_esp_holds_back_whole_series(folder: Path, tmp_path: Path) -> None:
    """Temperatures of the unseen series lie between the shown ones; viscosity only where meant."""
    for case in esp.prepare(folder, tmp_path):
        shown, unseen = (numbers(f, "pump.T [degC]") for f in (case.analysis, case.unseen))
        assert shown.min() < unseen.min()
        assert not set(np.round(shown, 5)) & set(np.round(unseen, 5))
        assert ("pump.mu [mPas]" in _header(case.analysis)) == ("with viscosity" in case.name)


@pytest.mark.prove
def test_plants_of_all_cases_compile(folder: Path, tmp_path: Path) -> None:
    """The copied plants find their knowledge."""
    prepared: Iterable[Case] = [
        *zema.prepare(folder, tmp_path),
        *hsy.prepare(folder, tmp_path),
        *esp.prepare(folder, tmp_path),
    ]
    for plant in sorted({case.plant for case in prepared}):
        ask.call("compile", plant, "-o", tmp_path / "ruleset.json")


def test_failures_carry_the_message(tmp_path: Path) -> None:
    """What the tool wrote is what the table shows."""
    with pytest.raises(ask.Failed, match="KB001"):
        ask.call("compile", tmp_path / "nothing")


def test_long_inputs_have_a_course(tmp_path: Path) -> None:
    """Rows are repeated, the time goes on."""
    source, target = tmp_path / "short.csv", tmp_path / "long.csv"
    source.write_text("time [s],A.dp [bar]\n0,1\n1,2\n", encoding="utf-8")
    speed.long_inputs(source, target, 5)
    assert [0, 1, 2, 3, 4] == numbers(target, "time [s]").tolist()
    assert [1, 2, 1, 2, 1] == numbers(target, "A.dp [bar]").tolist()


def test_periods_count_by_cycles() -> None:
    """A cycle is said to be faulty where a period covers more than half of its loaded part."""
    truth = {0: False, 1: True, 2: True, 3: False}
    found = hits([(60.0, 120.0), (180.0, 240.0), (121.0, 140.0)], truth, 60.0, 14.0)
    assert (2, 2, 1) == (found.true, found.said, found.both)
    assert (0.5, 0.5) == (found.precision, found.recall)


def test_nothing_said_has_no_precision() -> None:
    """Without periods the recall is 0 and the precision undefined."""
    found = hits([], {0: True}, 60.0, 0.0)
    assert 0.0 == found.recall
    assert np.isnan(found.precision)


def test_likeness_is_a_correlation(tmp_path: Path) -> None:
    """A course that falls with the removed column, on other times, is fully alike."""
    time = np.arange(50.0)
    series, recording = tmp_path / "series.csv", tmp_path / "recording.csv"
    course = "".join(f"{t},{-3 * t}\n" for t in time[::5])
    series.write_text(f"time [s],main.law [l/min]\n{course}", encoding="utf-8")
    rows = "".join(f"{t},{20 + t}\n" for t in time)
    recording.write_text(f"time [s],TS1 [degC]\n{rows}", encoding="utf-8")
    assert likeness(series, recording, "TS1 [degC]") == pytest.approx(1.0)


def test_errors_leave_out_what_is_not_predicted() -> None:
    """Empty cells are no errors."""
    assert rms(np.array([3.0, np.nan, -3.0])) == 3.0


def test_plateaus_are_rows_of_one_cycle() -> None:
    """Every plateau of a wanted cycle is one group of its seconds."""
    time = np.arange(180.0)
    groups = zema.plateau_rows(np.floor(time / 60), time, {0, 2})
    assert 2 * len(zema.PLATEAUS) == len(groups)
    assert [13, 14, 15, 16, 17, 18] == groups[0].tolist()
    assert {0.0, 120.0} == {float(60 * (g[0] // 60)) for g in groups}


def test_answers_are_read_and_shown(tmp_path: Path) -> None:
    """The machine form gives verdict, names, periods and one row of the table."""
    file = tmp_path / "answer.json"
    file.write_text(json.dumps(FORM), encoding="utf-8")
    answer = Answer(json.loads(file.read_text(encoding="utf-8")), file, 3.0)
    assert "named" == answer.verdict
    assert [("some-effect", "main", "law", 0.9)] == answer.named
    assert [(60.0, 180.0)] == answer.periods
    assert [(600.0, 720.0)] == answer.located
    out = Console(width=200, record=True, quiet=False, file=(tmp_path / "out").open("w"))
    case = Case("rig", file, file, file, "0.02")
    show_answers(out, [(case, answer), (case, "no answer")])
    text = out.export_text()
    assert "0.08 / 0.07 / 0.02" in text
    assert "no answer" in text
