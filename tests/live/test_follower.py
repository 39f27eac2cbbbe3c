"""Rows in, events out: the same mathematics as of a whole recording, in bounded memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live import limits, state
from rulec_runtime.live.batches import judged
from rulec_runtime.live.connection import noticed
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import Memory, follow, nothing_yet
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.view.present import Present
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording
from rulec_runtime.recordings.when import BRIEFLY_GONE

from tests.conftest import ROOT, compiled
from tests.rig.follower.agreement import first_rows
from tests.rig.follower.plants import part_of
from tests.runtime.tanks import made, plant

ABC = ROOT / "plants" / "abc" / "examples"


def recording_of(plant: str, name: str) -> tuple[Ruleset, Recording]:
    rules = compiled(plant)
    return rules, read_recording(ROOT / "plants" / plant / "examples" / name, rules)


def followed(
    rules: Ruleset, recording: Recording, step: int, memory: Memory | None = None
) -> tuple[Memory, list[Event], Diagnosis]:
    memory = memory or nothing_yet(False)
    events: list[Event] = []
    for first in range(0, len(recording), step):
        for told in follow(rules, memory, part_of(recording, first, first + step)):
            memory = told.memory
            events += told.events
    return memory, events, told.diagnosis


@pytest.mark.parametrize(
    ("plant", "name"),
    [("abc", "leakage_A.csv"), ("abc", "healthy.csv"), ("mixing-rig", "clogging_D.csv")],
)
def test_the_end_is_the_diagnosis_of_the_whole(plant: str, name: str) -> None:
    rules, recording = recording_of(plant, name)
    whole = diagnose(recording, rules)
    _, events, last = followed(rules, recording, 13)
    assert last.findings == whole.findings
    assert last.sensors == whole.sensors
    told = {e.episode.subject for e in events if e.episode.kind == "fault"}
    assert told == {f.fault.id for f in whole.findings}


def test_row_by_row_each_fault_is_told_once_and_soon() -> None:
    rules, recording = recording_of("abc", "leakage_A.csv")
    _, events, _ = followed(rules, first_rows(recording, 45), 1)
    told = [(e.what, e.episode.subject, e.episode.since) for e in events]
    assert told == [
        ("began", "A.leakage", 11.0),
        ("ended", "A.leakage", 11.0),
        ("began", "A.leakage", 31.0),
        ("ended", "A.leakage", 31.0),
    ]
    # Three samples make a settled stretch, the first of them behind the jump is left out.
    assert [e.time - e.episode.since for e in events if e.what == "began"] == [2.0, 2.0]
    assert [e.number for e in events] == [1, 2, 3, 4]


@pytest.mark.parametrize("step", [1, 14, 100])
def test_a_fault_that_outlasts_a_gap_is_told_once(step: int) -> None:
    """While the plant is not read, nothing ends; in whatever blocks its rows come."""
    rules, recording = recording_of("abc", "leakage_A.csv")
    some = first_rows(recording, 25)
    some = replace(some, time=some.time + 100.0 * (some.time > 15.0))
    _, events, _ = followed(rules, some, step)
    told = [(e.what, e.episode.subject, e.episode.since) for e in events]
    assert told == [("began", "A.leakage", 11.0), ("ended", "A.leakage", 11.0)]
    assert events[-1].time > 119.0


def long_recording(rules: Ruleset, faulty: int) -> Recording:
    """Healthy rows ten times over, and a leakage of 20 % for many rows at the end."""
    _, healthy = recording_of("abc", "healthy.csv")
    _, leaking = recording_of("abc", "leakage_A.csv")
    many = -(-3 * limits.KEPT_ROWS // len(healthy))
    values = {
        n: np.concatenate([np.tile(v, many), np.tile(leaking.values[n][12:19], faulty // 7)])
        for n, v in healthy.values.items()
    }
    n = len(values["A.n"])
    return replace(healthy, time=np.arange(float(n)), values=values, segment=np.zeros(n, dtype=int))


def test_memory_stays_bounded_and_a_long_fault_stays_one() -> None:
    rules = compiled("abc")
    recording = long_recording(rules, 3 * limits.KEPT_ROWS)
    memory, events, last = followed(rules, recording, 500)
    assert len(memory.recent) < 2 * limits.KEPT_ROWS
    assert memory.before is not None
    assert len(memory.before) <= limits.MOST_POINTS
    assert [(e.what, e.episode.subject) for e in events if e.episode.kind == "fault"][:1] == [
        ("began", "A.leakage")
    ]
    (active,) = (one for one in memory.episodes if one.active)
    assert active.subject == "A.leakage"
    assert active.lower < 0.2 < active.upper
    # Rows that it rests on are long gone.
    assert active.since < recording.time[-1] - 2.5 * limits.KEPT_ROWS
    assert last.samples == len(recording)


def test_what_is_remembered_survives_as_bytes() -> None:
    rules = compiled("abc")
    recording = long_recording(rules, 70)
    half = len(recording) - 100
    memory, _, _ = followed(rules, first_rows(recording, half), 1000)
    again, position = state.from_bytes(rules, state.to_bytes(rules, memory, {"offset": 7}), "x")
    assert position == {"offset": 7}
    assert memory.before is not None
    assert again.episodes == memory.episodes
    stood = {"A.dp": np.ones(len(memory.before), dtype=bool)}
    points = replace(memory.before.points, stood_in=stood)
    moved = replace(memory, before=replace(memory.before, points=points))
    kept, _ = state.from_bytes(rules, state.to_bytes(rules, moved, {}), "x")
    assert kept.before is not None
    assert kept.before.points.stood_in["A.dp"].all()
    rest = part_of(recording, half, len(recording))
    one, other = ([*follow(rules, m, rest)][-1] for m in (memory, again))
    assert one.events == other.events
    assert one.diagnosis.findings == other.diagnosis.findings
    assert any(e.episode.subject == "A.leakage" for e in one.events)


def test_states_that_are_none_are_refused() -> None:
    rules = compiled("abc")
    data = state.to_bytes(rules, nothing_yet(True), {})
    assert state.from_bytes(rules, data, "x")[0].count == 0
    with pytest.raises(RecordingRefused, match="of another ruleset"):
        state.from_bytes(compiled("mixing-rig"), data, "x")
    half = data.replace(b"recent/segment", b"recent/nothing")
    for bad in (b"", b"no state", data[: len(data) // 2], half):
        with pytest.raises(RecordingRefused, match="no state of a watch"):
            state.from_bytes(rules, bad, "x")


def test_readings_that_stay_away_are_an_alarm() -> None:
    memory = nothing_yet(False)
    told = []
    for notice in (
        Notice("connected", 0.0, "server: 7 of 7 signals"),
        Notice("lost", 5.0, "server: no answer"),
        Notice("stale", 6.0, "server: nothing new"),
        Notice("gap", 7.0, "9 s are missing"),
        Notice("connected", 8.0, "one server of two is back", still=True),
        Notice("connected", 9.0, "server is back"),
    ):
        memory, events = noticed(memory, notice)
        told += [(e.what, e.episode.since, e.episode.active) for e in events]
    assert told == [
        ("noted", 0.0, False),
        ("began", 5.0, True),
        ("noted", 7.0, False),
        ("noted", 8.0, False),
        ("ended", 5.0, False),
    ]
    assert not any(one.active for one in memory.episodes)


def test_a_signal_without_readings_is_a_check_of_function_of_its_module() -> None:
    """Beside others that are read, also by the next process; it ends with a reading."""
    rules = compiled("abc")
    nan, some = np.full(2, np.nan), np.ones(2)

    def rows(first: float, dp: np.ndarray) -> Rows:
        return Rows(np.array([first, first + 1.0]), {"A.dp": dp, "A.n": some})

    memory, told = nothing_yet(False), list[Event]()
    for came in (
        rows(0.0, nan),
        Notice("stale", 1.0, "A.dp: an array", signal="A.dp"),
        Notice("stale", 2.0, "A.dp: Uncertain", signal="A.dp"),
        rows(2.0, nan),
    ):
        for remembered, events, _ in judged(rules, memory, [came]):
            memory, told = remembered, [*told, *events]
    present = Present(rules, "opcua", memory).now()
    assert (present.status, present.connected, present.active[0].module) == ("C", True, "A")
    memory, _ = state.from_bytes(rules, state.to_bytes(rules, memory, {}), "state")
    for remembered, events, _ in judged(rules, memory, [rows(4.0, some)]):
        memory, told = remembered, [*told, *events]
    assert [(e.what, e.text) for e in told] == [
        ("began", "A.dp: an array"),
        ("changed", "A.dp: Uncertain"),
        ("ended", "A.dp is read again"),
    ]
    assert not memory.episodes


def test_a_plant_that_stores_is_followed() -> None:
    """In blocks, by the diagnosis of all rows that are there."""
    rules = compiled("cascaded-tanks")
    time = np.arange(60.0)
    level = {n: np.full(60, rules.signal_by_id[n].reference) for n in sorted(rules.read)}
    memory = nothing_yet(False)
    for first in (0, 30):
        part = slice(first, first + 30)
        rows = Rows(time[part], {n: v[part] for n, v in level.items()})
        for told in follow(rules, memory, rows):
            memory = told.memory
    assert memory.count == 60
    assert memory.before is None
    whole = diagnose(memory.recent, rules)
    assert len(memory.recent) == 60
    assert told.diagnosis.findings == whole.findings
    assert told.diagnosis.unknown == whole.unknown
    assert told.diagnosis.judged == whole.judged


def followed_to(
    recording: Recording, ends: Sequence[int]
) -> tuple[Memory, list[tuple[int, Event]], list[Diagnosis]]:
    """Looks at so many rows each: events of faults with the rows that there were, and diagnoses."""
    rules, memory = plant("cascaded-tanks"), nothing_yet(False)
    events, seen = [], []
    for first, last in pairwise([0, *ends]):
        for told in follow(rules, memory, part_of(recording, first, last)):
            memory = told.memory
            seen.append(told.diagnosis)
            events += [(last, e) for e in told.events if e.episode.kind == "fault"]
    return memory, events, seen


TANK = ("lower.y.low", 0.2, 0.5)
"""A level that reads 20 % too low from the middle of a recording on."""


def test_a_fault_of_a_tank_that_lasts_is_told_once() -> None:
    """With every row windows are cut anew, some across the beginning of the fault. The reading that
    shows it is beyond its threshold, and was not before."""
    recording = made("cascaded-tanks", 1, TANK, count=600)
    memory, events, seen = followed_to(recording, (300, 400, 432, 433, 463))
    assert [(e.what, e.episode.subject) for _, e in events] == [("began", "lower.y.low")]
    (episode,) = [one for one in memory.episodes if one.kind == "fault"]
    assert episode.active
    assert episode.lower <= 0.2 <= episode.upper
    assert abs(episode.since - 1200.0) < 256.0  # between two windows
    latest = [d.latest for d in seen if d.latest is not None]
    assert len(latest) == len(seen)
    assert [one.until for one in latest[:2]] == [recording.time[299], recording.time[399]]
    beyond = [[e.residual for e in one.residuals if e.verdict == "+"] for one in latest]
    assert beyond == [[]] + 4 * [["lower.y"]]


@pytest.mark.prove
def test_row_by_row_a_fault_of_a_tank_is_told_once() -> None:
    for seed in (1, 2):
        recording = made("cascaded-tanks", seed, TANK, count=600)
        _, events, _ = followed_to(recording, range(300, 601))
        assert {e.episode.subject for _, e in events} == {"lower.y.low"}
        assert [e.what for _, e in events if e.what != "changed"] == ["began"]


def test_a_fault_of_a_tank_that_ends_is_told_to_end() -> None:
    """Once as many windows say so as it takes to say that it is there."""
    recording = made("cascaded-tanks", 1, ("lower.y.low", 0.2, 0.25), count=520, until=0.65)
    memory, events, seen = followed_to(recording, (338, 375, 520))
    assert [(e.what, e.episode.subject, rows) for rows, e in events] == [
        ("began", "lower.y.low", 338),
        ("ended", "lower.y.low", 520),
    ]
    (found,) = seen[1].findings
    assert found.active
    assert found.behind == BRIEFLY_GONE
    assert abs(events[-1][1].episode.until - 1352.0) < 96.0
    assert not any(one.active for one in memory.episodes)


def test_no_reading_of_a_healthy_tank_is_beyond_its_threshold() -> None:
    """A window may deviate by chance; a finding takes three in a row, and so does a residual."""
    recording, odd = made("wastewater-lab", 1, count=400), 0
    for rows in (240, 270):
        diagnosis = diagnose(first_rows(recording, rows), plant("wastewater-lab"))
        assert diagnosis.latest is not None
        odd += any("3 windows in a row" in p.text for p in diagnosis.not_judged)
        assert diagnosis.status == "ok"
        assert {e.verdict for e in diagnosis.latest.residuals} == {"0"}
    assert odd
