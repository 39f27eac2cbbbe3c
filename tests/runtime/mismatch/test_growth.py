"""Faults that grow: told with onset and rate; a step and a fault that is always there are not."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest

from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.story import finding_facts
from rulec.mismatch.answer.terminal_and_page import report
from rulec.mismatch.evidence.configuration import Configuration, lasting
from rulec.mismatch.result import Finding, Mismatch
from tests.runtime.mismatch.made import USUAL, alone, compared, recorded, tour
from tests.runtime.pages import subject

SAMPLES, SINCE, REACHED = 240, 96.0, 0.5
RATE = 3600.0 * REACHED / (SAMPLES - 1 - SINCE)
CLOGGING = "A.clogging"
GIVEN = {**tour(alone()[0], SAMPLES), "A.T": np.full(SAMPLES, USUAL)}


def degree(shape: str) -> np.ndarray:
    """Degrees of a fault, shape (samples,)."""
    time = np.arange(SAMPLES)
    grown = np.maximum(time - SINCE, 0.0) / (SAMPLES - 1 - SINCE)
    return REACHED * {"grows": grown, "begins": time >= SINCE, "lasts": np.ones(SAMPLES)}[shape]


@functools.cache
def answer(shape: str) -> Mismatch:
    return compared(alone(), recorded(alone(), GIVEN, {CLOGGING: {"x": degree(shape)}}))


def clogging(shape: str) -> Finding:
    (finding,) = answer(shape).findings
    assert CLOGGING == finding.id
    return finding


def test_a_fault_that_grows_is_told_with_its_rate() -> None:
    """Onset within three of its uncertainties, rate within its bounds, nothing at first. It is to
    be mended, not adopted."""
    finding = clogging("grows")
    (period,) = finding.periods
    growth = period.growth
    assert growth is not None
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
    (period,) = clogging("begins").periods
    assert period.growth is None
    assert abs(period.since - SINCE) <= 2.0
    assert () == clogging("lasts").periods


def test_growth_is_told_in_words_and_in_json() -> None:
    """Terminal, headline, picture; the machine form keeps its keys and adds one."""
    found, since = answer("grows"), "grows since 96\u00a0s"
    (told,) = dict(finding_facts(found.findings[0]))["when"]
    assert told.startswith(f"{since}, from 0 to 0.5")
    assert told.endswith("per hour)")
    assert since in found.headline
    assert report(found, subject()).count("grows since") > 2
    form, step = (json.loads(json.dumps(mismatch_form(m, "x"))) for m in (found, answer("begins")))
    ((period,), (plain,)) = (f["effects"][0]["periods"] for f in (form, step))
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
