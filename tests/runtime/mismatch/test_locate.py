"""Where a mismatch sits, in which region and when; what a model predicts for a reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.model import Variable
from rulec.mismatch.evidence.region import periods_of, region_of
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.locate import (
    alike,
    noise_scale,
    suspects,
)
from rulec.mismatch.evidence.steady.predict import predictors_for
from rulec.mismatch.evidence.steady.system import System
from tests.runtime.mismatch.made import alone, opened, recorded, rows_at, tour
from tests.runtime.mismatch.warm import SAMPLES, joined, plain, trial

TIME = np.arange(400.0)


def shown(course: Array) -> Variable:
    return Variable(course, 1.0, 0.0, "1")


def system() -> System:
    return plain().rows.system


def test_the_suspected_place_is_the_wrong_one() -> None:
    """An error of the slip explains nearly all that noise does not."""
    found = suspects(plain())
    best = {s.spot.id: s.share for s in found}
    assert best["definition:A.Q_geo"] == pytest.approx(max(best.values()), abs=0.05)
    assert best["definition:A.Q_geo"] > 0.8
    assert best["definition:A.P_law"] < 0.6
    assert all(0.0 <= s.share <= 1.0 for s in found)


def test_nothing_is_suspect_once_it_is_repaired() -> None:
    """What is left of the residuals with the effect is noise: its scale is 1."""
    repaired = joined(plain(), trial())
    assert noise_scale(plain().rows, repaired.residual) == pytest.approx(1.0, abs=0.1)
    assert float(repaired.scale) < 1.1


def test_a_place_looks_like_itself() -> None:
    """Places are told apart by how their errors spread."""
    slip, power = (
        next(s for s in suspects(plain()) if s.spot.id == f"definition:A.{name}")
        for name in ("Q_geo", "P_law")
    )
    assert alike(slip, slip)
    assert not alike(slip, power)


@pytest.mark.parametrize(("low", "high"), [(0.6, None), (None, 0.3), (0.4, 0.7)])
def test_a_region_is_found(low: float | None, high: float | None) -> None:
    """A mismatch that sits above, below or between values of a reading, to five percent."""
    draw = np.random.default_rng(3)
    n = len(system().data)
    reading, other = draw.uniform(0, 1, n), draw.uniform(0, 1, n)
    inside = (reading >= (low or 0.0)) & (reading <= (high or 1.0))
    contribution = np.where(inside, 1.0, 0.0)
    (region,) = region_of(
        contribution, {"A.dp": Variable(reading * 1e5, 1e5, 0.0, "bar"), "A.P_el": shown(other)}
    )
    assert ("A.dp", "bar") == (region.variable, region.unit)
    for expected, found in ((low, region.low), (high, region.high)):
        assert (expected is None) == (found is None)
        if expected is not None:
            assert expected == pytest.approx(found, abs=0.06)
    assert region.share > 0.95


def test_a_mismatch_that_is_everywhere_has_no_region() -> None:
    """Nor has none at all."""
    n = len(system().data)
    reading = np.random.default_rng(3).uniform(0, 1, n)
    assert () == region_of(np.ones(n), {"A.dp": shown(reading)})
    assert () == region_of(np.zeros(n), {"A.dp": shown(reading)})
    assert () == region_of(np.full(n, np.nan), {"A.dp": shown(reading)})


def test_periods_are_told_where_there_are_few() -> None:
    """Two spans of time; none for what is always there, or nowhere."""

    def course(*spans: tuple[int, int]) -> Array:
        values = np.full(400, 0.01)
        for a, b in spans:
            values[a:b] = 1.0
        return values

    found = periods_of(TIME, course((50, 100), (300, 350)))
    assert np.allclose([(50, 100), (300, 350)], found, atol=5)
    assert () == periods_of(TIME, course((0, 400)))
    assert () == periods_of(TIME, np.zeros(400))
    assert () == periods_of(TIME, np.full(400, np.nan))


@pytest.mark.parametrize("plant", ["alone", "abc"])
def test_predictions_solve_the_residual(plant: str) -> None:
    """The predicted reading is that of the simulation where readings are free of noise."""
    where = alone() if plant == "alone" else opened(plant)
    rules, _ = where
    recording = recorded(where, tour(rules, SAMPLES), seed=None)
    found = rows_at(where, recording).system
    predictor = predictors_for(found, tuple(o.id for o in found.observers), frozenset())[0]
    assert not predictor.signal.is_input
    predicted = predictor.predicted(Configuration())
    judged = predictor.points
    measured = found.data.values[predictor.signal.id]
    assert measured[judged] == pytest.approx(predicted[judged], rel=1e-9)


def test_where_a_law_has_no_value_nothing_is_predicted() -> None:
    """The reading itself, from which the search begins, would count as without error."""
    rules, _ = alone()
    found = rows_at(alone(), recorded(alone(), tour(rules, SAMPLES))).system
    speed = found.data.values["A.n"].copy()
    speed[0] = np.nan
    points = replace(found.data.points, values={**found.data.values, "A.n": speed})
    lost = replace(found, data=replace(found.data, points=points))
    (predictor, *_) = predictors_for(lost, ("A.pump",), frozenset())
    every = replace(predictor, points=np.ones(len(speed), dtype=bool))
    assert [True, False] == np.isnan(every.predicted(Configuration()))[:2].tolist()


def test_predictions_are_off_by_the_noise() -> None:
    """Measured less predicted scatters as the readings' noise says."""
    rules, _ = alone()
    recording = recorded(alone(), tour(rules, 600, hold=60), moved=False)
    found = rows_at(alone(), recording).system
    predictor = predictors_for(found, ("A.pump",), frozenset())[0]
    off = (found.data.values[predictor.signal.id] - predictor.predicted(Configuration()))[
        predictor.points
    ]
    expected = predictor.noise(Configuration())[predictor.points]
    ratio = off / expected
    assert 1.0 == pytest.approx(float(np.std(ratio)), rel=0.2)


def test_a_place_of_flow_is_told_by_a_flow_meter_if_there_is_one() -> None:
    """Else by another reading of the residuals that the place moves; no set value is predicted."""
    found = predictors_for(system(), ("A.pump", "A.power"), frozenset({"A.T"}), "l/h")[0]
    assert {"A.pump", "A.power"} & {t.observer for t in found.residual.terms}
    assert found.signal.id in ("A.dp", "A.P_el")
    assert not found.of_flow
    assert [] == predictors_for(system(), (), frozenset())


def test_too_few_points_predict_nothing() -> None:
    """Where pressures make no sense nothing is predicted, and nothing breaks."""
    rules, _ = alone()
    recording = recorded(alone(), tour(rules, 60))
    broken = {**recording.values, "A.dp": np.full(60, 1.0)}
    found = rows_at(
        alone(),
        Recording(
            time=recording.time, values=broken, segment=recording.segment, missing=(), notes=()
        ),
    ).system
    assert [] == predictors_for(found, ("A.plant",), frozenset())
