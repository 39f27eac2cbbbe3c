"""Faults that grow: told with onset and rate; a step and a fault that is always there are not."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest

from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.shown import report
from rulec.mismatch.answer.story import finding_facts
from rulec.mismatch.evidence.steady.configuration import Configuration, lasting
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.onset import onset_of
from rulec.mismatch.result import Finding, Mismatch, Period
from rulec.mismatch.search.settled.scan import at_points
from tests.runtime.mismatch.made import USUAL, alone, compared, recorded, rows_at, tour
from tests.runtime.pages import subject

SAMPLES, SINCE, REACHED = 240, 96.0, 0.5
RATE = 3600.0 * REACHED / (SAMPLES - 1 - SINCE)
CLOGGING = "A.clogging"
SEEDS = (1, pytest.param(2, marks=pytest.mark.prove))


def degree(shape: str) -> np.ndarray:
    """Degrees of a fault, shape (samples,)."""
    time = np.arange(SAMPLES)
    grown = np.maximum(time - SINCE, 0.0) / (SAMPLES - 1 - SINCE)
    return REACHED * {"grows": grown, "begins": time >= SINCE, "lasts": np.ones(SAMPLES)}[shape]


@functools.cache
def answer(shape: str, seed: int) -> Mismatch:
    given = {**tour(alone()[0], SAMPLES), "A.T": np.full(SAMPLES, USUAL)}
    built = {CLOGGING: {"x": degree(shape)}}
    return compared(alone(), recorded(alone(), given, built, seed=seed))


def clogging(shape: str, seed: int) -> Finding:
    (finding,) = answer(shape, seed).findings
    assert CLOGGING == finding.id
    return finding


@pytest.mark.parametrize("seed", SEEDS)
def test_a_fault_that_grows_is_told_with_its_rate(seed: int) -> None:
    """Onset within three of its uncertainties, rate within its bounds, nothing at first."""
    finding = clogging("grows", seed)
    (period,) = finding.periods
    growth = period.growth
    assert growth is not None
    assert abs(period.since - SINCE) < 3.0 * growth.u_since
    assert growth.lower <= RATE <= growth.upper
    assert period.until == SAMPLES - 1
    assert abs(period.degree - REACHED) < 3.0 * period.u
    assert finding.probability > 0.9
    assert "fault" == answer("grows", seed).verdict


@pytest.mark.parametrize("seed", SEEDS)
def test_a_step_does_not_grow(seed: int) -> None:
    (period,) = clogging("begins", seed).periods
    assert period.growth is None
    assert abs(period.since - SINCE) <= 2.0


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_always_there_does_not_grow(seed: int) -> None:
    assert () == clogging("lasts", seed).periods


def test_growth_is_told_in_words_and_in_json() -> None:
    """Terminal, headline, picture; the machine form keeps its keys and adds one."""
    found = answer("grows", 1)
    (finding,) = found.findings
    (told,) = dict(finding_facts(finding))["when"]
    assert told.startswith("grows since 96\u00a0s, from 0 to 0.5")
    assert told.endswith("per hour)")
    assert "grows since 96\u00a0s" in found.headline
    form = json.loads(json.dumps(mismatch_form(found, "plant")))
    ((period,),) = (effect["periods"] for effect in form["effects"])
    assert {"since", "until", "degree", "u", "grows"} == set(period)
    assert {"rate", "u", "lower", "upper", "u_since", "per"} == set(period["grows"])
    assert report(found, subject()).count("grows since") > 2
    (plain,) = mismatch_form(answer("begins", 1), "plant")["effects"][0]["periods"]
    assert {"since", "until", "degree", "u"} == set(plain)


def test_what_grows_is_not_adopted() -> None:
    """A fault is to be mended."""
    ((name, reason),) = answer("grows", 1).left_out
    assert CLOGGING == name
    assert "mended" in reason
    assert () == answer("grows", 1).repair.joined


def test_a_course_that_grows_reaches_its_degree_at_the_end() -> None:
    time = np.arange(5.0)
    course = lasting("x", 1.0, time, grows=True)
    np.testing.assert_allclose(course.degrees({"x#0": 0.6}), [0.0, 0.0, 0.2, 0.4, 0.6])
    np.testing.assert_allclose(course.since(2.0, time).share(0), [0.0, 0.0, 0.0, 0.5, 1.0])
    step = lasting("x", 1.0, time)
    assert not step.since(2.0, time).grows
    np.testing.assert_allclose(step.since(2.0, time).share(0), [0, 0, 1, 1, 1])


def test_a_degree_at_other_points_is_the_same_at_each_time() -> None:
    """Means end before the recording does."""
    means, points = np.array([1.0, 3.0, 5.0]), np.arange(8.0)
    setting = Configuration(values={"x#0": 0.8}, courses=(lasting("x", 1.0, means, grows=True),))
    there = at_points(setting, points)
    degrees = there.courses[0].degrees(there.values)
    np.testing.assert_allclose(degrees[[1, 3, 5]], setting.courses[0].degrees(setting.values))
    assert there.courses[0].periods[0].until == 7.0


def test_an_onset_that_is_off_is_moved_the_right_way() -> None:
    """The Gauss-Newton step from an onset 10 s late goes back; it is not known exactly."""
    given = {**tour(alone()[0], SAMPLES), "A.T": np.full(SAMPLES, USUAL)}
    rows = rows_at(
        alone(), recorded(alone(), given, {CLOGGING: {"x": degree("grows")}}, moved=False)
    )
    candidate = next(c for c in rows.system.candidates if c.id == CLOGGING)
    late = lasting(f"{CLOGGING}.x", SINCE + 10.0, rows.system.data.time, grows=True)
    setting = Configuration().joining(candidate, {late.names()[0]: REACHED}, {}, late)
    fitted: Fitted = fit(rows, setting, rows.system.data.open)
    known = onset_of(fitted, fitted.setting.courses[0])
    assert -20.0 < known.step < -3.0
    assert 0.0 < known.u_since < 5.0
    assert known.u_degree > fitted.u(late.names()[0])


def test_a_period_that_does_not_grow_has_no_growth() -> None:
    assert Period(0.0, 1.0, 0.1, 0.01).growth is None


@pytest.mark.prove
def test_a_fault_that_shows_the_other_way_round_does_not_take_its_place() -> None:
    """Begun when the right one begins, it would be pressed to nothing; it must not be likelier."""
    given = {**tour(alone()[0], SAMPLES), "A.T": np.full(SAMPLES, USUAL)}
    begun = {"A.dp.high": {"x": 0.1 * (np.arange(SAMPLES) >= SINCE)}}
    found = compared(alone(), recorded(alone(), given, begun, seed=4))
    assert ["A.dp.high"] == [f.id for f in found.findings]
