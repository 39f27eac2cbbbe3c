"""What cannot be seen because readings are not there is told, and nothing else is."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.detectable_faults import visible_of
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.hidden_faults import blind_of, coverage_of
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.blindness import blindness, brought_back, unseen

from rulec.study.sensors_needed import without_each
from tests.conftest import compiled
from tests.dosing import RIGS, TABLE_1, operating_points, record, visiting_run
from tests.rig.follower.plants import followed
from tests.runtime.mismatch.made import changed, without
from tests.runtime.sheets import sampled
from tests.runtime.test_sensor_health import logged

GONE_WITH_DP = {
    *(f"A.{fault}" for fault in ("leakage", "clogging", "widening")),
    *(f"A.{sensor}.{way}" for sensor in ("dp", "P_el") for way in ("high", "low")),
    *("C.clogging", "C.widening"),
}
"""Without A.dp no estimate of A can be used, and the mixer's line is seen by balances alone."""


@cache
def run_of(dwell: int = 25) -> Recording:
    rig = RIGS["abc"]
    run = visiting_run(rig, operating_points(rig, 4), {}, lead_in=0, dwell=dwell)
    return logged(compiled("abc"), record(run, TABLE_1, 5).readings)


def gone(recording: Recording, name: str, rows: slice | Array) -> Recording:
    values = recording.values[name].copy()
    values[rows] = np.nan
    return changed(recording, {name: values})


def test_readings_that_bring_faults_back() -> None:
    """With the fewest that do: what is named brings it back, and no part of it would."""
    whole, rules, names = run_of(), compiled("abc"), ("A.n", "A.dp", "A.P_el")
    blind = diagnose(without(whole, *names), rules).blind
    back = {fault: set(b.readings) for b in blind for fault in b.faults}
    assert set(back) == GONE_WITH_DP
    reported = [back[f] for f in ("A.leakage", "A.clogging", "A.P_el.high")]
    assert [{"A.n", "A.dp"}, {"A.dp"}, set(names)] == reported
    nothing = {n: np.full(len(whole), np.nan) for n in whole.values}
    found = diagnose(replace(whole, values=nothing), rules)
    assert ("C", 0) == (found.status, found.judged)
    assert sorted(f.id for f in rules.faults) == sorted(f for b in found.blind for f in b.faults)
    for fault, readings in ((f, b.readings) for b in found.blind for f in b.faults):
        for some, seen in [(readings, True), (readings[1:], False)]:
            assert seen == visible_of(rules).sees(fault, rules.read - set(some))


@pytest.mark.parametrize(
    ("rows", "spans"),
    [
        (slice(None), [(0.0, 99.0, True)]),
        (slice(0, 20), [(0.0, 19.0, False)]),
        (slice(60, None), [(60.0, 99.0, True)]),
        (slice(40, 39 + limits.PERSISTENCE), []),
        (slice(40, 40 + limits.PERSISTENCE), [(40.0, 39.0 + limits.PERSISTENCE, False)]),
        (slice(101 - limits.PERSISTENCE, None), []),
        (slice(0, None, 2), []),
        (np.flatnonzero(np.arange(100) % 4), [(0.0, 99.0, True)]),
    ],
)
def test_since_and_until_when(rows: slice | Array, spans: list[tuple[float, float, bool]]) -> None:
    """Readings in every second row are enough, in every fourth they are not."""
    found = diagnose(gone(run_of(), "A.dp", rows), compiled("abc"))
    assert spans == [(b.since, b.until, b.active) for b in found.blind]
    assert all((GONE_WITH_DP, ("A.dp",)) == (set(b.faults), b.readings) for b in found.blind)
    lost = 9 / 18 * sum(until - since for since, until, _ in spans) / 99.0
    assert coverage_of(found.ruleset, found.blind, 0.0, 99.0) == pytest.approx(1.0 - lost)
    assert found.status == ("C" if spans else "ok")
    assert found.is_whole == (not spans)


def test_a_pump_at_rest_hides_nothing() -> None:
    """It is blind while it runs, and pauses do not end that, nor does a night."""
    rules, whole = compiled("abc"), run_of()
    pauses = {
        (0, 100): [],
        (0, 50): [(50.0, 99.0)],
        (40, 60): [(0.0, 99.0)],
        (60, 100): [(0.0, 99.0)],
    }
    for pause, expected in pauses.items():
        speed = whole.values["A.n"].copy()
        speed[slice(*pause)] = 0.5 * (rules.signal_by_id["A.n"].minimum or np.nan)
        blind = blind_of(changed(without(whole, "A.dp"), {"A.n": speed}), rules)
        periods = [b for b in blind if GONE_WITH_DP & set(b.faults)]
        assert expected == sorted({(b.since, b.until) for b in periods if "A.leakage" in b.faults})
        assert bool(periods) == bool(expected)


def test_a_sensor_that_a_column_map_leaves_out_is_none() -> None:
    rules = compiled("cascaded-tanks")
    time = np.arange(100.0)
    few = sampled({"pump.u": 2.5 + np.sin(time), "lower.y": 5.0 + np.cos(time)})
    assert () == blind_of(few, rules)
    assert {"lower.y"} == {r for b in blind_of(without(few, "lower.y"), rules) for r in b.readings}


def test_the_watch_says_the_same() -> None:
    rules = compiled("abc")
    recording = gone(run_of(dwell=75), "A.dp", slice(100, None))
    told = followed(rules, recording, 10)
    texts = {e.text for e in told.events if e.episode.kind == "blind"}
    (episode,) = [e for e in told.memory.episodes if e.kind == "blind"]
    (blind,) = diagnose(recording, rules).blind
    assert ("C", blind.since, True) == (episode.status, episode.since, episode.active)
    assert {f"{unseen(rules, blind)}: {blind.because}"} == {episode.text} == texts
    assert brought_back(blind) == episode.action
    assert blindness(rules, blind).endswith(f"{blind.because}; {episode.action}")


def test_what_each_sensor_is_needed_for() -> None:
    """Without a sensor the matrix lacks exactly the faults that a recording without it hides."""
    rules = compiled("abc")
    table = without_each(rules)
    assert json.loads(json.dumps(table)) == table
    assert table.keys() == rules.read
    for signal, lost in table.items():
        undetectable = {f for b in blind_of(without(run_of(), signal), rules) for f in b.faults}
        assert undetectable == set(lost["unseen"])
        for group in lost["merged"]:
            assert not undetectable & set(group)
    assert ["A.dp.high", "A.P_el.low"] in table["C.dp"]["merged"]
    assert [] == table["A.P_el"]["merged"]


def test_a_large_plant_asks_what_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    rules: Ruleset = compiled("mixing-rig")
    lost = {"A.dp"}
    every = set(visible_of(rules).unseen(lost))
    monkeypatch.setattr(limits, "NEAREST_ESTIMATES", 8)
    rules.cache.pop("visible")
    near = visible_of(rules)
    rules.cache.pop("visible")
    assert len(near.parts) > 1
    assert every == set(near.unseen(lost))
