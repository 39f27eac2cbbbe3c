"""Where a mismatch sits, in which region, and when: faults that come and go, and that grow."""

import functools
import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.story import finding_facts
from rulec.mismatch.answer.terminal_and_page import report
from rulec.mismatch.evidence.configuration import Configuration, lasting
from rulec.mismatch.evidence.model import Variable, periods_of, region_of
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.repaired_model import predictors_for
from rulec.mismatch.evidence.steady.screen import InitialCandidate, columns_of
from rulec.mismatch.result import Mismatch
from rulec.mismatch.search.intermittent_fault import Segments, apart, cut, degree_course, in_periods
from rulec.mismatch.search.latent_input import described, reconstruct
from rulec.mismatch.search.limits import ODD, STEP_PENALTY
from rulec.mismatch.search.operating_states import search
from tests.runtime.mismatch.made import (
    SLIP,
    USUAL,
    alone,
    compared,
    fitted,
    loaded,
    recorded,
    rows_at,
    tour,
    warmed,
    without,
)
from tests.runtime.mismatches import FAULT
from tests.runtime.reports import subject

N = 400


@pytest.mark.parametrize(("low", "high"), [(0.6, None), (None, 0.3), (0.4, 0.7)])
def test_a_region_is_found(low: float | None, high: float | None) -> None:
    reading, other = np.random.default_rng(3).uniform(0, 1, (2, N))
    inside = (reading >= (low or 0.0)) & (reading <= (high or 1.0))
    read = {
        "A.dp": Variable(reading * 1e5, 1e5, 0.0, "bar"),
        "A.P_el": Variable(other, 1.0, 0.0, "1"),
    }
    (region,) = region_of(np.where(inside, 1.0, 0.0), read)
    assert ("A.dp", "bar") == (region.variable, region.unit)
    for expected, found in ((low, region.low), (high, region.high)):
        assert (expected is None) == (found is None)
        assert expected is None or expected == pytest.approx(found, abs=0.06)
    assert region.share > 0.95
    for share in (1.0, 0.0, np.nan):
        assert () == region_of(np.full(N, share), read)


def test_periods_are_told_where_there_are_few() -> None:
    time = np.arange(float(N))
    there = ((time >= 50) & (time < 100)) | ((time >= 300) & (time < 350))
    found = periods_of(time, np.where(there, 1.0, 0.01))
    assert np.allclose([(50, 100), (300, 350)], found, atol=5)
    for none in (1.0, 0.0, np.nan):
        assert () == periods_of(time, np.full(N, none))


@pytest.mark.parametrize("plant", ["alone", "abc"])
def test_predictions_solve_the_residual(plant: str) -> None:
    where = alone() if plant == "alone" else loaded(plant)
    found = rows_at(where, recorded(where, tour(where[0], 240), seed=None)).system
    predictor = predictors_for(found, tuple(o.id for o in found.observers), frozenset())[0]
    assert not predictor.signal.is_input
    predicted, judged = predictor.predicted(Configuration()), predictor.points
    measured = found.data.values[predictor.signal.id]
    assert measured[judged] == pytest.approx(predicted[judged], rel=1e-9)


def test_predictions_are_off_by_the_noise() -> None:
    """Where a law has no value nothing is predicted: the reading would count as exact."""
    recording = recorded(alone(), tour(alone()[0], 600, dwell=60), moved=False)
    found = rows_at(alone(), recording).system
    predictor = predictors_for(found, ("A.pump",), frozenset())[0]
    off = found.data.values[predictor.signal.id] - predictor.predicted(Configuration())
    ratio = (off / predictor.noise(Configuration()))[predictor.points]
    assert 1.0 == pytest.approx(float(np.std(ratio)), rel=0.2)
    speed = found.data.values["A.n"].copy()
    speed[0] = np.nan
    points = replace(found.data.points, values={**found.data.values, "A.n": speed})
    lost = replace(found, data=replace(found.data, points=points))
    (predictor, *_) = predictors_for(lost, ("A.pump",), frozenset())
    every = replace(predictor, points=np.ones(len(speed), dtype=bool))
    assert [True, False] == np.isnan(every.predicted(Configuration()))[:2].tolist()


TIME = np.arange(0.0, 3601.0, 10.0)
PHASE = TIME / TIME[-1]
WARM = 1.0 - np.exp(-TIME / 600.0)
TRUE = {SLIP: {"b": 0.03, "T0": USUAL}}


def test_a_course_in_words() -> None:
    way = "slow, {} from the start, two thirds of the way within 10 min"
    wave = np.sin(np.pi * PHASE) ** 2
    for course, expected in (
        (np.full(len(TIME), 3.0), "constant"),
        (WARM, way.format("rises")),
        (-1e6 * WARM, way.format("falls")),
        (7.0 + 1e-9 * wave, "slow, turns 1 time over 1 h"),
        (-wave, "slow, turns 1 time over 1 h"),
        (np.sin(2 * np.pi * PHASE) ** 4, "slow, turns 3 times over 1 h"),
    ):
        assert expected == described(TIME, course)
    assert "turns" not in described(TIME, PHASE + 0.02 * np.sin(200 * PHASE))
    up_first = np.sin(4 * np.pi * PHASE)
    assert "falls from the start" not in described(TIME, up_first)
    for seconds, span in ((60.0, "1 min"), (36000.0, "10 h")):
        assert f"over {span}" in described(seconds * PHASE, up_first)
    stops = np.concatenate([TIME, TIME + 9000.0])  # warms up, stands for an hour, is cold again
    assert described(stops, np.concatenate([WARM, WARM])).endswith("returns during stops")


def test_what_drives_a_slip_shows_in_its_parameter() -> None:
    """The pressure moves; an error that adds to the flow would have to move with it."""
    run = warmed(TRUE)
    found = search(rows_at(alone(), without(run, "A.T")), lambda text: None)
    (wandering,) = found.fitted.setting.joined
    assert wandering.id.startswith("parameter:A.C")
    assert wandering.place == "Q_geo"
    latent = reconstruct(found.fitted, wandering.id)
    warm = np.interp(latent.time, run.time, run.values["A.T"])
    assert abs(np.corrcoef(latent.course, warm)[0, 1]) > 0.9


@pytest.mark.prove
def test_one_driver_behind_two_laws_is_told_at_both() -> None:
    """A temperature nobody recorded moves friction and slip: two courses that are alike."""
    built = {**TRUE, "A.friction-temperature@P_law": {"b": 0.02, "T0": USUAL}}
    found = compared(alone(), without(warmed(built), "A.T"))
    assert found.verdict == "unnamed"
    assert not found.findings
    assert [where.place for where in found.locations] == ["P_law", "Q_geo"]
    assert sum(where.share for where in found.locations) == pytest.approx(1.0)
    said = "in A.Q_geo changes too, and its course correlates with this one by −0.9"
    assert said in found.latent_input.text


LEAKAGE = "A.leakage"


def course(*levels: tuple[int, float], seed: int = 1) -> Array:
    """Levels one behind the other, each (means, size in units of noise), with unit noise."""
    noise = np.random.default_rng(seed).standard_normal(sum(n for n, _ in levels))
    return np.concatenate([np.full(n, level) for n, level in levels]) + noise


def states(values: Array, odd: float = 0.0) -> list[tuple[int, int]]:
    """First and last mean (excluded) of what is apart."""
    segments = cut(values, STEP_PENALTY * float(np.log(len(values))))
    on = apart(segments, odd)
    flags = np.zeros(len(values) + 2, dtype=int)
    for first, length in zip(segments.first[on], segments.length[on], strict=True):
        flags[first + 1 : first + length + 1] = 1
    return [(int(a), int(b)) for a, b in np.flatnonzero(np.diff(flags)).reshape(-1, 2)]


@pytest.mark.parametrize("seed", range(3))
def test_levels_are_told_from_noise(seed: int) -> None:
    quiet = course((N, 0.0), seed=seed)
    assert [0] == cut(quiet, STEP_PENALTY * float(np.log(N))).first.tolist()
    assert [] == states(quiet)
    rest = (60, 0.0)
    values = course(rest, (40, 20.0), rest, (40, 40.0), rest, (50, 60.0), (100, 0.0), seed=seed)
    assert [(60, 100), (160, 200), (260, 310)] == states(values)


@pytest.mark.parametrize("odd", ODD)
def test_drift_is_no_fault(odd: float) -> None:
    phase = np.linspace(0.0, 1.0, N)
    bump, waves = np.sin(np.pi * phase) ** 2, np.sin(6 * np.pi * phase)
    for drift in (phase, bump, waves, 1.0 - np.exp(-5.0 * phase)):
        assert [] == states(50.0 * drift + course((N, 0.0)), odd)


def test_odd_levels_are_no_state() -> None:
    values = course((100, 0.0), (6, -400.0), (100, 0.0), (80, 15.0), (100, 0.0))
    assert [(100, 106), (206, 286)] == states(values, 0.0)
    assert [(206, 286)] == states(values, 0.02)
    segments = Segments(np.arange(3), np.array([1.0, np.nan, np.nan]), np.array([9, 9, 9]))
    assert not apart(segments).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_cut_is_optimal(seed: int) -> None:
    draw = np.random.default_rng(seed)
    values = np.repeat(draw.normal(0, 5, 4), 5) + draw.standard_normal(20)

    def cost(edges: tuple[int, ...]) -> float:
        parts = np.split(values, edges)
        return sum(float(np.sum((p - p.mean()) ** 2)) for p in parts) + 6.0 * len(edges)

    best = min(cost(edges) for k in range(4) for edges in combinations(range(1, 20), k))
    assert cost(tuple(cut(values, 6.0).first[1:].tolist())) <= best + 1e-9


@functools.cache
def plain(*degrees: tuple[int, int, float]) -> Fitted:
    degree = np.zeros(300)
    for since, until, x in degrees:
        degree[since:until] = x
    given = tour(loaded("abc")[0], 300)
    return fitted(loaded("abc"), recorded(loaded("abc"), given, {LEAKAGE: {"x": degree}}))


def trial(*degrees: tuple[int, int, float]) -> InitialCandidate | None:
    (leakage,) = (c for c in loaded("abc")[1].candidates if c.id == LEAKAGE)
    return in_periods(plain(*degrees), leakage)


@pytest.mark.parametrize("x", [0.02, 0.6])
def test_small_and_large_faults_are_seen(x: float) -> None:
    """Points with a strong fault are far out, and still speak of it."""
    assert trial() is None
    found = trial((100, 160, x))
    (period,) = found.course.periods
    assert 100 <= period.since < 115
    assert 145 < period.until < 161


def test_points_that_do_not_speak_of_a_fault_have_no_degree() -> None:
    """Where a module moves, only rounding is left of its slopes."""
    found = plain((40, 80, 0.2), (130, 160, 0.4), (200, 230, 0.2))
    (leakage,) = (c for c in loaded("abc")[1].candidates if c.id == LEAKAGE)
    columns = columns_of(found, leakage, {f"{LEAKAGE}.x": 0.0}, {})
    mute = found.rows.point % 3 > 0
    degree, _ = degree_course(found, np.where(mute, 1e-14 * columns[:, 0], columns[:, 0]))
    points = np.flatnonzero(np.isfinite(degree))
    assert len(points) > 50
    assert set(points) <= set(found.rows.point[~mute])
    assert np.abs(degree[points]).max() < 1.0


SAMPLES, SINCE, REACHED = 240, 96.0, 0.5
RATE = 3600.0 * REACHED / (SAMPLES - 1 - SINCE)
CLOGGING = "A.clogging"
GIVEN = {**tour(alone()[0], SAMPLES), "A.T": np.full(SAMPLES, USUAL)}


def degree(shape: str) -> np.ndarray:
    time = np.arange(SAMPLES)
    grown = np.maximum(time - SINCE, 0.0) / (SAMPLES - 1 - SINCE)
    return REACHED * {"grows": grown, "begins": time >= SINCE, "lasts": np.ones(SAMPLES)}[shape]


@functools.cache
def answer(shape: str) -> Mismatch:
    return compared(alone(), recorded(alone(), GIVEN, {CLOGGING: {"x": degree(shape)}}))


def test_a_fault_that_grows_is_told_with_its_rate() -> None:
    """It is to be mended, not adopted."""
    (finding,) = answer("grows").findings
    assert CLOGGING == finding.id
    (period,) = finding.periods
    growth = period.growth
    assert abs(period.since - SINCE) < 3.0 * growth.u_since
    assert growth.lower <= RATE <= growth.upper
    assert period.until == SAMPLES - 1
    assert abs(period.degree - REACHED) < 3.0 * period.u
    assert finding.probability > 0.9
    assert "fault" == answer("grows").verdict
    ((name, reason),) = answer("grows").left_out
    assert CLOGGING == name
    assert "mended" in reason
    assert () == answer("grows").repair.joined


@pytest.mark.prove
def test_a_step_and_what_is_always_there_do_not_grow() -> None:
    (begun,), (always,) = (answer(shape).findings for shape in ("begins", "lasts"))
    assert (CLOGGING, CLOGGING, ()) == (begun.id, always.id, always.periods)
    (period,) = begun.periods
    assert period.growth is None
    assert abs(period.since - SINCE) <= 2.0


def test_growth_is_told_in_words_and_in_json() -> None:
    found, since = answer("grows"), "grows since 96\u00a0s"
    (row,) = dict(finding_facts(found.findings[0]))["when"]
    assert row.startswith(f"{since}, from 0 to 0.5")
    assert row.endswith("per hour)")
    assert since in found.headline
    assert report(found, subject()).count("grows since") > 2
    form, step = (json.loads(json.dumps(mismatch_form(m, "x"))) for m in (found, FAULT))
    ((period,), (plain, *_)) = (f["effects"][0]["periods"] for f in (form, step))
    assert {"since", "until", "degree", "u"} == set(plain) == set(period) - {"grows"}
    assert {"rate", "u", "lower", "upper", "u_since", "per"} == set(period["grows"])


def test_a_course_that_grows_reaches_its_degree_at_the_end() -> None:
    """At other points it has the same degree at each time, also where means end earlier."""
    time = np.arange(5.0)
    course, step = lasting("x", 1.0, time, grows=True), lasting("x", 1.0, time)
    np.testing.assert_allclose(course.degrees({"x#0": 0.6}), [0.0, 0.0, 0.2, 0.4, 0.6])
    np.testing.assert_allclose(course.since(2.0, time).share(0), [0.0, 0.0, 0.0, 0.5, 1.0])
    np.testing.assert_allclose(step.since(2.0, time).share(0), [0, 0, 1, 1, 1])
    means = lasting("x", 1.0, np.array([1.0, 3.0, 5.0]), grows=True)
    there = Configuration(values={"x#0": 0.8}, courses=(means,)).at_points(np.arange(8.0))
    degrees = there.courses[0].degrees(there.values)
    np.testing.assert_allclose(degrees[[1, 3, 5]], means.degrees({"x#0": 0.8}))
    assert there.courses[0].periods[0].until == 7.0


@pytest.mark.prove
def test_a_fault_that_shows_the_other_way_round_does_not_take_its_place() -> None:
    """Begun when the right one begins, it would be pressed to nothing; it must not be likelier."""
    begun = {"A.dp.high": {"x": 0.1 * (np.arange(SAMPLES) >= SINCE)}}
    found = compared(alone(), recorded(alone(), GIVEN, begun, seed=4))
    assert ["A.dp.high"] == [f.id for f in found.findings]
