"""Where a mismatch sits, in which region and when; a driver that nobody recorded."""

from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.model import Variable, periods_of, region_of
from rulec.mismatch.evidence.steady.repaired_model import predictors_for
from rulec.mismatch.search.latent_input import described, reconstruct
from rulec.mismatch.search.operating_states import search
from tests.runtime.mismatch.made import (
    SLIP,
    USUAL,
    alone,
    compared,
    opened,
    recorded,
    rows_at,
    tour,
    warmed,
    without,
)

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
    where = alone() if plant == "alone" else opened(plant)
    found = rows_at(where, recorded(where, tour(where[0], 240), seed=None)).system
    predictor = predictors_for(found, tuple(o.id for o in found.observers), frozenset())[0]
    assert not predictor.signal.is_input
    predicted, judged = predictor.predicted(Configuration()), predictor.points
    measured = found.data.values[predictor.signal.id]
    assert measured[judged] == pytest.approx(predicted[judged], rel=1e-9)


def test_predictions_are_off_by_the_noise() -> None:
    """Where a law has no value nothing is predicted: the reading would count as exact."""
    recording = recorded(alone(), tour(alone()[0], 600, hold=60), moved=False)
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


TIME = np.arange(0.0, 3600.0, 10.0)
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
        (7.0 + 1e-9 * wave, "slow, turns 1 time over 60 min"),
        (-wave, "slow, turns 1 time over 60 min"),
        (np.sin(2 * np.pi * PHASE) ** 4, "slow, turns 3 times over 60 min"),
    ):
        assert expected == described(TIME, course)
    assert "turns" not in described(TIME, PHASE + 0.02 * np.sin(200 * PHASE))
    up_first = np.sin(4 * np.pi * PHASE)
    assert "falls from the start" not in described(TIME, up_first)
    for seconds, span in ((60.0, "60 s"), (36000.0, "10.0 h")):
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
    hidden = reconstruct(found.fitted, wandering.id)
    warm = np.interp(hidden.time, run.time, run.values["A.T"])
    assert abs(np.corrcoef(hidden.course, warm)[0, 1]) > 0.9


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
    assert said in found.hidden.text
