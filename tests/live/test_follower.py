"""Rows in, events out: the same mathematics as of a whole recording, in bounded memory."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.live import limits, state
from rulec_runtime.live.changes import Horizon, changes
from rulec_runtime.live.connection import noticed
from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.live.follower import Update, follow, judged
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.live.moment import Present
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.recordings.plant_calendar import BRIEFLY_GONE
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording

from tests.conftest import ROOT, compiled
from tests.rig.follower.plants import first_rows, part_of
from tests.runtime.tanks import made, plant
from tests.runtime.test_courses import DEGREE, coming, read


def recording_of(plant: str, name: str) -> tuple[Ruleset, Recording]:
    rules = compiled(plant)
    return rules, read_recording(ROOT / "plants" / plant / "examples" / name, rules)


def followed(rules: Ruleset, recording: Recording, ends: Iterable[int]) -> list[Update]:
    """What is told as rows come, up to each of some numbers of them."""
    memory, updates = nothing_yet(False), list[Update]()
    for first, last in pairwise([0, *ends]):
        updates += follow(rules, memory, part_of(recording, first, last))
        memory = updates[-1].memory
    return updates


def events_of(updates: Iterable[Update], kind: str = "") -> list[Event]:
    return [e for one in updates for e in one.events if kind in ("", e.episode.kind)]


def active(memory: Memory) -> list[Episode]:
    return [one for one in memory.episodes if one.active]


@pytest.mark.parametrize("step", [1, 14])
def test_a_fault_that_outlasts_a_gap_is_told_once_and_soon(step: int) -> None:
    """While the plant is not read, nothing ends; in whatever blocks its rows come."""
    rules, recording = recording_of("abc", "leakage_A.csv")
    some = first_rows(recording, 25)
    some = replace(some, time=some.time + 100.0 * (some.time > 15.0))
    events = events_of(followed(rules, some, range(step, 25 + step, step)))
    reported = [(e.number, e.what, e.episode.subject, e.episode.since) for e in events]
    assert reported == [(1, "began", "A.leakage", 11.0), (2, "ended", "A.leakage", 11.0)]
    # Three samples make a settled stretch, the first of them behind the jump is left out.
    assert step > 1 or events[0].time - 11.0 == 2.0
    assert events[-1].time > 119.0


def long_recording(faulty: int) -> Recording:
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
    recording = long_recording(3 * limits.KEPT_ROWS)
    updates = followed(compiled("abc"), recording, range(500, len(recording) + 500, 500))
    memory = updates[-1].memory
    assert len(memory.recent) < 2 * limits.KEPT_ROWS
    assert memory.before is not None
    assert len(memory.before) <= limits.MOST_POINTS
    first, *_ = events_of(updates, "fault")
    assert (first.what, first.episode.subject) == ("began", "A.leakage")
    (leakage,) = active(memory)
    assert leakage.subject == "A.leakage"
    assert leakage.lower < 0.2 < leakage.upper
    # Rows that it rests on are long gone.
    assert leakage.since < recording.time[-1] - 2.5 * limits.KEPT_ROWS
    assert updates[-1].diagnosis.samples == len(recording)


def test_what_is_remembered_survives_as_bytes() -> None:
    """What is none is refused."""
    rules, recording = compiled("abc"), long_recording(70)
    half = len(recording) - 100
    memory = followed(rules, recording, [*range(1000, half, 1000), half])[-1].memory
    assert memory.before is not None
    stood = {"A.dp": np.ones(len(memory.before), dtype=bool)}
    points = replace(memory.before.points, stood_in=stood)
    memory = replace(memory, before=replace(memory.before, points=points))
    data = state.to_bytes(rules, memory, {"offset": 7})
    again, position = state.from_bytes(rules, data, "x")
    assert position == {"offset": 7}
    assert again.episodes == memory.episodes
    assert again.before is not None
    assert again.before.points.stood_in["A.dp"].all()
    rest = part_of(recording, half, len(recording))
    one, other = ([*follow(rules, m, rest)][-1] for m in (memory, again))
    assert one.events == other.events
    assert one.diagnosis.findings == other.diagnosis.findings
    assert any(e.episode.subject == "A.leakage" for e in one.events)
    with pytest.raises(RecordingRefused, match="of another ruleset"):
        state.from_bytes(compiled("mixing-rig"), data, "x")
    other_names = data.replace(b"recent/segment", b"recent/nothing")
    for bad in (b"", b"no state", data[: len(data) // 2], other_names):
        with pytest.raises(RecordingRefused, match="no state of a watch"):
            state.from_bytes(rules, bad, "x")


def test_readings_that_stay_away_are_an_alarm() -> None:
    memory, reported = nothing_yet(False), []
    for notice in (
        Notice("connected", 0.0, "server: 7 of 7 signals"),
        Notice("lost", 5.0, "server: no answer"),
        Notice("stale", 6.0, "server: nothing new"),
        Notice("gap", 7.0, "9 s are missing"),
        Notice("connected", 8.0, "one server of two is back", still=True),
        Notice("connected", 9.0, "server is back"),
    ):
        memory, events = noticed(memory, notice)
        reported += [(e.what, e.episode.since, e.episode.active) for e in events]
    noted = [("noted", at, False) for at in (0.0, 7.0, 8.0)]
    assert reported == [noted[0], ("began", 5.0, True), *noted[1:], ("ended", 5.0, False)]
    assert active(memory) == []


def test_a_signal_without_readings_is_a_check_of_function_of_its_module() -> None:
    """Beside others that are read, also by the next process; it ends with a reading."""
    rules, memory, reported = compiled("abc"), nothing_yet(False), list[tuple[str, str]]()

    def takes(part: Rows | Notice) -> None:
        nonlocal memory
        for remembered, events, _ in judged(rules, memory, [part]):
            memory = remembered
            reported.extend((e.what, e.text) for e in events)

    def rows(first: float, dp: float) -> Rows:
        return Rows(first + np.arange(2.0), {"A.dp": np.full(2, dp), "A.n": np.ones(2)})

    takes(rows(0.0, np.nan))
    takes(Notice("stale", 1.0, "A.dp: an array", signal="A.dp"))
    takes(Notice("stale", 2.0, "A.dp: Uncertain", signal="A.dp"))
    takes(rows(2.0, np.nan))
    present = Present(rules, "opcua", memory).now()
    assert (present.status, present.connected, present.active[0].module) == ("C", True, "A")
    memory, _ = state.from_bytes(rules, state.to_bytes(rules, memory, {}), "state")
    takes(rows(4.0, 1.0))
    texts = ("A.dp: an array", "A.dp: Uncertain", "A.dp is read again")
    assert reported == [*zip(("began", "changed", "ended"), texts, strict=True)]
    assert not memory.episodes


def test_a_stuck_reading_is_told_once_while_it_lasts() -> None:
    recording = long_recording(0)
    held = recording.values["A.dp"].copy()
    held[200:] = held[200]
    stuck = replace(recording, values={**recording.values, "A.dp": held})
    updates = followed(compiled("abc"), stuck, range(100, 700, 100))
    (event,) = events_of(updates, "sensor")
    assert (event.what, event.episode.subject) == ("began", "A.dp.stuck")
    assert event.episode.id in {one.id for one in active(updates[-1].memory)}


TANK = ("lower.y.low", 0.3, 0.5)
"""A level that reads 30 % too low from the middle of a recording on."""


def test_a_fault_of_a_tank_that_lasts_is_told_once() -> None:
    """With every row windows are cut anew, some across the beginning of the fault. The reading that
    shows it is beyond its threshold, and was not before. Each is the diagnosis of all rows."""
    recording = made("cascaded-tanks", 1, TANK, count=600)
    updates = followed(plant("cascaded-tanks"), recording, (300, 400, 401))
    (event,) = events_of(updates, "fault")
    assert (event.what, event.episode.subject) == ("began", "lower.y.low")
    memory = updates[-1].memory
    (episode,) = [one for one in active(memory) if one.kind == "fault"]
    assert episode.lower <= 0.3 <= episode.upper
    assert abs(episode.since - 1200.0) < 256.0  # between two windows
    latest = [one.diagnosis.latest for one in updates if one.diagnosis.latest is not None]
    assert len(latest) == len(updates)
    assert [one.until for one in latest[:2]] == [recording.time[299], recording.time[399]]
    beyond = [[e.residual for e in one.residuals if e.verdict == "+"] for one in latest]
    assert beyond == [[], ["lower.y"], ["lower.y"]]
    assert memory.count == len(memory.recent) == 401
    begun = updates[0].diagnosis
    whole = diagnose(first_rows(recording, 300), plant("cascaded-tanks"))
    assert begun.findings == whole.findings
    assert (begun.unknown, begun.judged) == (whole.unknown, whole.judged)


@pytest.mark.prove
def test_row_by_row_a_fault_of_a_tank_is_told_once() -> None:
    for seed in (1, 2):
        recording = made("cascaded-tanks", seed, TANK, count=600)
        updates = events_of(followed(plant("cascaded-tanks"), recording, range(300, 601)), "fault")
        assert {e.episode.subject for e in updates} == {"lower.y.low"}
        assert [e.what for e in updates if e.what != "changed"] == ["began"]


@pytest.mark.prove
def test_a_fault_of_a_tank_that_ends_is_told_to_end() -> None:
    """Once as many windows say so as it takes to say that it is there."""
    recording = made("cascaded-tanks", 1, ("lower.y.low", 0.2, 0.25), count=520, until=0.65)
    updates = followed(plant("cascaded-tanks"), recording, (338, 375, 520))
    faults = [[(e.what, e.episode.subject) for e in events_of([one], "fault")] for one in updates]
    assert faults == [[("began", "lower.y.low")], [], [("ended", "lower.y.low")]]
    (found,) = updates[1].diagnosis.findings
    assert found.active
    assert found.behind == BRIEFLY_GONE
    memory = updates[-1].memory
    (episode,) = [one for one in memory.episodes if one.kind == "fault"]
    assert abs(episode.until - 1352.0) < 96.0
    assert active(memory) == []


def test_no_reading_of_a_healthy_tank_is_beyond_its_threshold() -> None:
    """A window may deviate by chance; a finding takes three in a row, and so does a residual."""
    recording, odd = made("wastewater-lab", 2, count=400), 0
    for rows in (235, 305):
        diagnosis = diagnose(first_rows(recording, rows), plant("wastewater-lab"))
        assert diagnosis.latest is not None
        odd += any("3 windows in a row" in p.text for p in diagnosis.not_judged)
        assert diagnosis.status == "ok"
        assert {e.verdict for e in diagnosis.latest.residuals} == {"0"}
    assert odd


def test_a_fault_that_comes_and_goes_is_told_as_in_a_recording() -> None:
    """Shorter than a settled stretch each time: one alarm, however often it comes again."""
    rules, recording = compiled("abc"), read(coming(6, 60, DEGREE), 1)
    updates = followed(rules, recording, range(60, 361, 60))
    assert updates[-1].diagnosis.findings == diagnose(recording, rules).findings
    assert updates[-1].diagnosis.findings[0].events is not None
    happened = [(e.what, e.episode.subject) for e in events_of(updates)]
    assert happened == [("began", "A.leakage"), ("ended", "A.leakage")]


HORIZON = Horizon(np.arange(401.0), 400.0)


def test_a_fault_that_has_ended_is_set_right() -> None:
    """One of 100 s to 200 s: what was none is withdrawn, once, while it can be seen; what began
    earlier than told is told again; two that turn out to be one are not withdrawn."""
    rules, recording = recording_of("abc", "leakage_A.csv")
    whole = diagnose(recording, rules)
    finding = next(f for f in whole.findings if not f.active)
    over = replace(whole, findings=(replace(finding, since=100.0, until=200.0),))
    (episode,), events = changes(rules, (), over, HORIZON, 0)
    assert [e.what for e in events] == ["began", "ended"]

    none = replace(over, findings=())
    current, events = changes(rules, (episode,), none, HORIZON, 2)
    assert [(e.number, e.what, e.episode.id) for e in events] == [(3, "withdrawn", episode.id)]
    assert changes(rules, current, none, HORIZON, 3) == ((), ())
    later = replace(HORIZON, time=np.arange(150.0, 401.0))
    assert changes(rules, (episode,), none, later, 2)[1] == ()

    current, events = changes(rules, (replace(episode, active=True),), none, HORIZON, 1)
    assert ([e.what for e in events], current) == (["withdrawn"], ())
    # Readings of its beginning are gone: repaired since, and no false alarm.
    events = changes(rules, (replace(episode, active=True),), none, later, 1)[1]
    assert [e.what for e in events] == ["ended"]

    pair = (replace(episode, id="first", until=120.0), replace(episode, id="second", since=160.0))
    assert "withdrawn" not in [e.what for e in changes(rules, pair, over, HORIZON, 2)[1]]

    current, events = changes(rules, (replace(episode, since=180.0),), over, HORIZON, 2)
    assert [(e.what, e.episode.since) for e in events] == [("changed", 100.0)]
    assert "earlier" in events[0].text
    assert changes(rules, current, over, HORIZON, 3)[1] == ()


@pytest.mark.parametrize("running", [False, True])
def test_what_cannot_be_judged_is_one_episode_and_a_standstill_none(running: bool) -> None:
    """Why nothing is judged changes from sample to sample with the noise; that nothing is judged
    does not. Pumps that stand, as they do every night, are no news."""
    recording, random = long_recording(0), np.random.default_rng(0)
    values = {name: column.copy() for name, column in recording.values.items()}
    noise = {"A.dp": 200.0, "B.dp": 200.0, "C.dp": 100.0, "A.P_el": 0.1, "B.P_el": 0.1}
    for name, size in noise.items() if running else (noise | {"A.n": 0.0, "B.n": 0.0}).items():
        values[name][200:500] = size * random.standard_normal(300)
    updates = followed(compiled("abc"), replace(recording, values=values), range(50, 700, 50))
    until = (recording.time[200], recording.time[499])
    if not running:
        (why,) = {p.text for p in updates[-1].diagnosis.not_judged if p.rests}
        assert why == "at standstill: A.n is below 40 rpm, B.n is below 40 rpm"
        assert not events_of(updates, "blind")
        return
    began, ended = events_of(updates, "blind")
    assert (began.what, ended.what) == ("began", "ended")
    assert (ended.episode.since, ended.episode.until) == pytest.approx(until, abs=5.0)


def test_a_gauge_that_is_stuck_for_long_stays_stuck() -> None:
    """When no row with its noise is left in memory as well, until it moves again."""
    recording = long_recording(5 * limits.KEPT_ROWS)
    stuck, last = recording.values["C.dp"], 7 * limits.KEPT_ROWS
    stuck[600:last] = stuck[600]
    updates = followed(compiled("abc"), recording, range(500, len(recording) + 500, 500))
    told = [(e.what, e.episode.subject) for e in events_of(updates, "sensor")]
    assert told == [("began", "C.dp.stuck"), ("ended", "C.dp.stuck")]
    ended = events_of(updates, "sensor")[1].episode
    assert (ended.since, ended.until) == (recording.time[600], recording.time[last - 1])


def test_what_was_not_judged_long_ago_is_not_told_again() -> None:
    """Only operating points in memory still show it."""
    recording = long_recording(4 * limits.KEPT_ROWS)
    for name, column in recording.values.items():
        if name not in ("A.n", "B.n"):
            column[200:500] = np.nan
    updates = followed(compiled("abc"), recording, range(500, len(recording) + 500, 500))
    told = [(e.what, e.episode.subject) for e in events_of(updates, "blind")]
    assert len(told) == len({*told}) == 2 * len({subject for _, subject in told})
