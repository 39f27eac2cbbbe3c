"""What cannot be seen because readings are not there is told, and nothing else is.

Recordings come from the independent simulator; columns are taken out of them.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.blind import Blind, blind_of, coverage_of
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.visible import visible_of
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.blindness import blindness, brought_back, unseen

from rulec.cli import main
from rulec.prove.truth import RIGS, TABLE_1, operating_points, record, visiting_run
from rulec.study.without import without_each
from tests.conftest import ROOT, compiled
from tests.runtime import tanks
from tests.runtime.test_sensor_health import of_columns, put

GONE_WITH_DP = {
    *(f"A.{fault}" for fault in ("leakage", "clogging", "widening")),
    *(f"A.{sensor}.{way}" for sensor in ("dp", "P_el") for way in ("high", "low")),
    *("C.clogging", "C.widening"),
}
"""Without A.dp no estimate of A can be used, and the mixer's line is seen by balances alone."""


@cache
def run_of(plant: str = "abc", leakage: float = 0.0, lead_in: int = 0) -> Recording:
    """Several operating points, perhaps with a leakage in A behind sound samples."""
    rig = RIGS[plant]()
    faults = {"A.leakage": leakage} if leakage else {}
    run = visiting_run(rig, operating_points(rig, 4), faults, lead_in=lead_in, hold=25)
    return of_columns(compiled(plant), record(run, TABLE_1, 5).readings)


def without(recording: Recording, *names: str) -> Recording:
    """Without some columns."""
    return replace(recording, values={n: v for n, v in recording.values.items() if n not in names})


def gone(recording: Recording, name: str, rows: slice | Array) -> Recording:
    """Without some readings of a column."""
    values = recording.values[name].copy()
    values[rows] = np.nan
    return put(recording, name, values)


def said(recording: Recording, plant: str = "abc") -> Diagnosis:
    return diagnose(recording, compiled(plant))


def only(blind: tuple[Blind, ...]) -> Blind:
    (one,) = blind
    return one


@pytest.mark.parametrize("plant", ["abc", "mixing-rig"])
def test_what_all_readings_show_is_no_blindness(plant: str) -> None:
    found = said(run_of(plant), plant)
    assert ("ok", (), True) == (found.status, found.blind, found.is_whole)


@pytest.mark.parametrize("leakage", [0.0, 0.6])
def test_a_pressure_that_is_gone(leakage: float) -> None:
    """Absent, or there and empty: the same faults, and the same reading that brings them back."""
    whole = run_of(leakage=leakage, lead_in=25)
    for recording in (without(whole, "A.dp"), gone(whole, "A.dp", slice(None))):
        found = said(recording)
        blind = only(found.blind)
        assert "C" == found.status
        assert set(blind.faults) == GONE_WITH_DP
        assert (0.0, recording.time[-1], ("A.dp",)) == (blind.since, blind.until, blind.readings)
        assert blind.active
        assert not found.is_whole


def test_a_leakage_that_other_residuals_show_is_told_beside_what_cannot_be_seen() -> None:
    """The power reading is gone, the mixer's balance still shows the leakage."""
    found = said(without(run_of(leakage=0.6, lead_in=25), "A.P_el"))
    assert {"A.leakage"} == {f.fault.id for f in found.findings}
    assert {"A.P_el.high", "A.P_el.low"} == set(only(found.blind).faults)
    assert "C" == found.status


def test_exit_code_json_and_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command ends with 3, and each face says which reading brings back what."""
    text = (ROOT / "plants/abc/examples/leakage_A.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in text.splitlines()]
    dp = next(i for i, title in enumerate(rows[0]) if title.startswith("A.dp"))
    file, form, page = (tmp_path / name for name in ("few.csv", "few.json", "few.html"))
    file.write_text("".join(",".join(r[:dp] + r[dp + 1 :]) + "\n" for r in rows))
    plant = str(ROOT / "plants/abc")
    code = main(["diagnose", plant, str(file), "--json", str(form), "--report", str(page)])
    assert limits.NOT_ALL_SEEN == code
    data = json.loads(form.read_text())
    (blind,) = data["blind"]
    assert {"faults", "since", "until", "because", "readings"} == set(blind)
    assert (GONE_WITH_DP, ["A.dp"]) == (set(blind["faults"]), blind["readings"])
    assert "A.dp: not in the recording" == blind["because"]
    shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "Partly blind 9 of 18 faults could not be seen" in shown
    assert "cannot see any fault of A, C.clogging and C.widening since 0 s" in shown
    assert "A.dp brings them back" in shown
    assert "in part" not in shown
    assert "Partly blind: 9 of 18 faults" in page.read_text()
    whole = str(ROOT / "plants/abc/examples/leakage_A.csv")
    assert 0 == main(["diagnose", plant, whole, "-q"])


def test_a_module_without_any_reading() -> None:
    """Each fault with the fewest readings that bring it back."""
    names = ("A.n", "A.dp", "A.P_el")
    found = said(without(run_of(), *names))
    back = {fault: set(b.readings) for b in found.blind for fault in b.faults}
    assert set(back) == GONE_WITH_DP
    assert {"A.n", "A.dp"} == back["A.leakage"]
    assert {"A.dp"} == back["A.clogging"]
    assert set(names) == back["A.P_el.high"]


def test_no_reading_at_all() -> None:
    """Every fault, each once; what is named does bring it back, and no part of it would."""
    whole, rules = run_of(), compiled("abc")
    found = said(replace(whole, values={n: np.full(len(whole), np.nan) for n in whole.values}))
    assert ("C", 0) == (found.status, found.judged)
    assert sorted(f.id for f in rules.faults) == sorted(f for b in found.blind for f in b.faults)
    visible = visible_of(rules)
    for blind in found.blind:
        for fault in blind.faults:
            for back, seen in [(blind.readings, True), (blind.readings[1:], False)]:
                assert seen == visible.sees(fault, rules.read - set(back))


def test_since_and_until_when() -> None:
    """Gone at the start only: it is over; gone from a row on: it is not."""
    start = only(said(gone(run_of(), "A.dp", slice(0, 20))).blind)
    assert (0.0, 19.0, False) == (start.since, start.until, start.active)
    end = only(said(gone(run_of(), "A.dp", slice(60, None))).blind)
    assert (60.0, 99.0, True) == (end.since, end.until, end.active)


def test_readings_that_come_with_every_second_row_are_enough() -> None:
    found = said(gone(run_of(), "A.dp", np.arange(0, 100, 2)))
    assert ("ok", (), ()) == (found.status, found.blind, found.not_judged)


def test_readings_that_most_rows_lack_are_not() -> None:
    rows = np.flatnonzero(np.arange(100) % 4)
    blind = only(blind_of(gone(run_of(), "A.dp", rows), compiled("abc")))
    assert (GONE_WITH_DP, ("A.dp",)) == (set(blind.faults), blind.readings)


@pytest.mark.parametrize("end", [True, False])
def test_a_gap_shorter_than_a_finding_is_none(end: bool) -> None:
    for rows in (limits.PERSISTENCE - 1, limits.PERSISTENCE):
        first = 100 - rows if end else 40
        found = said(gone(run_of(), "A.dp", slice(first, first + rows)))
        told = [(b.since, b.until) for b in found.blind]
        assert told == ([] if rows < limits.PERSISTENCE else [(first, first + rows - 1.0)])
        assert found.status == ("C" if told else "ok")


def test_a_pump_at_rest_hides_nothing() -> None:
    """What stands still by its own speed would show nothing with its pressure either; it is blind
    while it runs."""
    rules, whole = compiled("abc"), run_of()
    still = whole.values["A.n"].copy()
    low = rules.signal_by_id["A.n"].minimum
    assert low is not None
    still[:] = 0.5 * low
    rest = put(without(whole, "A.dp"), "A.n", still)
    hidden = {f for b in blind_of(rest, rules) for f in b.faults}
    assert not hidden & GONE_WITH_DP
    still[50:] = whole.values["A.n"][50:]
    blind = only(blind_of(put(rest, "A.n", still), rules))
    assert (50.0, GONE_WITH_DP) == (blind.since, set(blind.faults))


def test_pauses_do_not_end_a_blindness() -> None:
    """A pump that rests for a while is as blind behind it as before: one period."""
    rules, whole = compiled("abc"), run_of()
    speed = whole.values["A.n"].copy()
    speed[40:60] = 0.0
    blind = blind_of(put(without(whole, "A.dp"), "A.n", speed), rules)
    own = {(b.since, b.until) for b in blind if "A.leakage" in b.faults}
    assert {(0.0, 99.0)} == own


def test_a_sensor_that_a_column_map_leaves_out_is_none() -> None:
    """Only the lower of two tanks has a level sensor; that of the upper one is no loss."""
    rules = compiled("cascaded-tanks")
    recording = tanks.made("cascaded-tanks", 1)
    few = without(recording, "upper.y")
    assert () == blind_of(few, rules)
    assert {"lower.y"} == {r for b in blind_of(without(few, "lower.y"), rules) for r in b.readings}


def test_the_watch_says_the_same() -> None:
    """Same faults, reason and reading as of the whole recording, from one function."""
    rules = compiled("abc")
    recording = gone(_longer(run_of(), 3), "A.dp", slice(100, None))
    memory, texts = nothing_yet(False), set[str]()
    for low in range(0, len(recording), 10):
        part = slice(low, low + 10)
        rows = Rows(recording.time[part], {n: v[part] for n, v in recording.values.items()})
        for told in follow(rules, memory, rows):
            memory = told.memory
            texts |= {e.text for e in told.events if e.episode.kind == "blind"}
    (episode,) = [e for e in memory.episodes if e.kind == "blind"]
    blind = only(diagnose(recording, rules).blind)
    assert ("C", blind.since, True) == (episode.status, episode.since, episode.active)
    assert f"{unseen(rules, blind)}: {blind.because}" == episode.text
    assert {episode.text} == texts
    assert brought_back(blind) == episode.action
    assert blindness(rules, blind).endswith(f"{blind.because}; {episode.action}")


def _longer(recording: Recording, times: int) -> Recording:
    """The same several times."""
    n = len(recording)
    return replace(
        recording,
        time=np.arange(times * n, dtype=np.float64),
        values={name: np.tile(values, times) for name, values in recording.values.items()},
        segment=np.zeros(times * n, dtype=int),
    )


EXAMPLES = sorted((ROOT / "plants").glob("*/examples/*.csv"))
NO_OPERATION = ("inputs", "truth", "calibration", "step_B")
"""Set points alone, true degrees, and modules that stand alone on a bench one after the other,
while the readings of the others are indeed not there."""
SOUND = [f for f in EXAMPLES if not any(name in f.name for name in NO_OPERATION)]


@pytest.mark.parametrize("file", SOUND, ids=lambda f: f"{f.parts[-3]}-{f.stem}")
def test_shipped_recordings_hide_nothing(file: Path) -> None:
    """All their readings are there but for those that are found to be none."""
    rules = compiled(file.parts[-3])
    assert () == blind_of(read_recording(file, rules), rules)


def test_coverage_is_the_share_of_the_time_of_all_faults() -> None:
    rules, recording = compiled("abc"), run_of()
    blind = blind_of(gone(recording, "A.dp", slice(50, None)), rules)
    share = len(GONE_WITH_DP) / len(rules.faults) * 49.0 / 99.0
    assert coverage_of(rules, blind, 0.0, 99.0) == pytest.approx(1.0 - share)
    assert 1.0 == coverage_of(rules, (), 0.0, 0.0)


def test_what_each_sensor_is_needed_for() -> None:
    """Without a sensor the matrix lacks exactly the faults that a recording without it hides."""
    rules = compiled("abc")
    table = without_each(rules)
    assert json.loads(json.dumps(table)) == table
    assert table.keys() == rules.read
    for signal, lost in table.items():
        hidden = {f for b in blind_of(without(run_of(), signal), rules) for f in b.faults}
        assert hidden == set(lost["unseen"])
        for group in lost["merged"]:
            assert not hidden & set(group)
    assert ["A.dp.high", "A.P_el.low"] in table["C.dp"]["merged"]
    assert [] == table["A.P_el"]["merged"]


def test_a_large_plant_asks_what_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the nearest estimates say of a rig is what all of them say."""
    rules: Ruleset = compiled("mixing-rig")
    lost = {"A.dp"}
    every = set(visible_of(rules).unseen(lost))
    monkeypatch.setattr(limits, "NEAREST_ESTIMATES", 8)
    rules.kept.pop("visible")
    near = visible_of(rules)
    rules.kept.pop("visible")
    assert len(near.parts) > 1
    assert every == set(near.unseen(lost))
