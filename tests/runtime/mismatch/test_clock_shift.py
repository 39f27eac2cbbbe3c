"""Columns recorded by a clock that is off: told as such, and no lag is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording

from rulec.cli import main
from tests.conftest import ROOT
from tests.runtime.mismatch.made import changed, opened, recorded, sampled, tour, without
from tests.runtime.mismatch.test_structure import TANKS, example, looked, rewritten
from tests.runtime.tanks import made

LONGEST = 20
"""Half as long as states last."""


def off(recording: Recording, signals: tuple[str, ...], late: float) -> Recording:
    """The recording with columns that come so many seconds late."""
    return Mending(signals=signals, late=-late).of(recording)


def drawn(plant: str, recording: Recording, random: np.random.Generator) -> tuple[str, int]:
    """A column that some estimate reads, and by how many samples it is late (or early)."""
    read = sorted({s for o in opened(plant)[0].observers for s in o.signals})
    names = [name for name in read if name in recording.values]
    by = round(float(np.exp(random.uniform(np.log(2.0), np.log(LONGEST)))))
    return str(random.choice(names)), by * int(random.choice([-1, 1]))


def test_readings_are_moved_in_time_within_their_file() -> None:
    values = np.arange(8.0)
    recording = replace(
        sampled({"A.n": values, "A.dp": values}), time=5.0 * values, segment=np.arange(8) // 4
    )
    found = Mending(signals=("A.n",), late=10.0).of(recording).values
    assert np.array_equal(found["A.n"], [2, 3, np.nan, np.nan, 6, 7, np.nan, np.nan], True)
    assert np.array_equal(found["A.dp"], values)
    both = Mending(signals=("A.n", "A.dp"), late=-5.0).of(recording).values
    assert np.array_equal(both["A.dp"], [np.nan, 0, 1, 2, np.nan, 4, 5, 6], True)
    assert np.array_equal(both["A.n"], both["A.dp"], True)


def run(seed: int) -> Recording:
    return recorded(opened("abc"), tour(opened("abc")[0], 400, hold=40), seed=seed)


def test_columns_of_another_clock_are_found() -> None:
    """Drawn at six seeds, late or early by up to half as long as states last; clean recordings have
    one clock."""
    right = 0
    for seed in range(6):
        recording = run(seed + 1)
        assert () == looked("abc", without(recording, "A.l"))
        signal, by = drawn("abc", recording, np.random.default_rng(seed))
        found = looked("abc", off(recording, (signal,), float(by)))
        meant = Mending(signals=(signal,), late=float(by))
        assert all(meant == t.hypothesis.mending for t in found), (signal, by)
        right += len(found)
    assert right >= 6


def test_no_other_time_is_told_where_states_are_shorter_than_the_shift() -> None:
    """Ten samples each: read three later, every state would be compared with the one before."""
    assert () == looked("abc", off(example("abc", "calibration"), ("A.P_el",), 13.0))


@pytest.mark.parametrize(("signal", "pace"), [("A.P_el", 2.0), ("C.dp", 6.0), ("A.n", 6.0)])
def test_a_lag_is_no_clock(signal: str, pace: float) -> None:
    """A transmitter with damping, or a pump that follows what was set."""
    recording = run(3)
    values = recording.values[signal].copy()
    for i in range(1, len(values)):
        values[i] += np.exp(-1.0 / pace) * (values[i - 1] - values[i])
    assert () == looked("abc", changed(recording, {signal: values}))


def test_all_columns_of_a_module_may_have_a_clock_of_their_own() -> None:
    recording = run(2)
    names = tuple(n for n in recording.values if n.startswith("A."))
    (found,) = looked("abc", off(recording, names, -5.0))
    assert {"A.n", "A.dp", "A.P_el"} == set(found.hypothesis.mending.signals)
    assert -5.0 == found.hypothesis.mending.late
    assert "5 s too early" in found.hypothesis.text


@pytest.mark.parametrize(
    ("seed", "signal", "late"),
    [
        (1, "tank1.l", -124.0),
        pytest.param(5, "supply.Q", 44.0, marks=pytest.mark.prove),
    ],
)
def test_a_plant_that_stores_cannot_answer_before_its_cause(
    seed: int, signal: str, late: float
) -> None:
    (found,) = looked(TANKS, off(made(TANKS, seed), (signal,), late))
    assert found.hypothesis.mending == Mending(signals=(signal,), late=late)


@pytest.mark.parametrize(("signal", "late"), [("tank1.l", 60.0), ("supply.Q", -60.0)])
def test_what_a_delay_of_the_catalogue_explains_is_left_to_it(signal: str, late: float) -> None:
    """A dead time of a sensor, a flow that arrives late."""
    assert () == looked(TANKS, off(made(TANKS, 3), (signal,), late))


@pytest.mark.prove
def test_the_answer_says_by_how_much_and_its_plant_can_be_adopted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, answer = tmp_path / "recording.csv", tmp_path / "answer.json"
    rewritten(file, "A.P_el [W]", lambda column: column[-4:] + column[:-4])
    assert 0 == main(["mismatch", str(ROOT / "plants/abc"), str(file), "--json", str(answer)])
    shown = " ".join(capsys.readouterr().out.split())
    assert "A.P_el is recorded 4 s too late against the others" in shown
    form = json.loads(answer.read_text(encoding="utf-8"))
    assert "sensor" == form["verdict"]
    assert ("clock-shift", "A.P_el") == tuple(form["effects"][0][k] for k in ("effect", "place"))
    assert 4.0 == form["repair"]["misread"][0]["late"]
    assert 0 == main(["adopt", str(answer), "--recalibrated", "-o", str(tmp_path / "adopted")])
