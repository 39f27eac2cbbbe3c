"""Where a mismatch sits, in which region and when; what a model predicts for a reading."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.model import Variable
from rulec.mismatch.evidence.region import periods_of, region_of
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.locate import alike, noise_scale, suspects
from rulec.mismatch.evidence.steady.predict import predictors_for
from rulec.mismatch.evidence.steady.screen import screen
from tests.runtime.mismatch.made import (
    SLIP,
    USUAL,
    alone,
    changed,
    fitted,
    joined,
    opened,
    recorded,
    rows_at,
    tour,
    warmed,
)

N = 400


@functools.cache
def plain() -> Fitted:
    """The plain model refitted to a pump whose slip follows its temperature."""
    return fitted(alone(), warmed({SLIP: {"b": 0.03, "T0": USUAL}}))


def test_the_suspected_place_is_the_wrong_one() -> None:
    """An error of the slip explains nearly all that noise does not, and looks like itself alone;
    with the effect, noise is left, whose scale is 1."""
    found = {s.spot.id: s for s in suspects(plain())}
    slip, power = (found[f"definition:A.{name}"] for name in ("Q_geo", "P_law"))
    assert all(0.0 <= s.share <= 1.0 for s in found.values())
    assert slip.share == pytest.approx(max(s.share for s in found.values()), abs=0.05)
    assert slip.share > 0.8
    assert power.share < 0.6
    assert alike(slip, slip)
    assert not alike(slip, power)
    (trial,) = screen(plain(), [c for c in alone()[1].candidates if c.id == SLIP])
    repaired = joined(plain(), trial)
    assert noise_scale(plain().rows, repaired.residual) == pytest.approx(1.0, abs=0.1)
    assert float(repaired.scale) < 1.1


@pytest.mark.parametrize(("low", "high"), [(0.6, None), (None, 0.3), (0.4, 0.7)])
def test_a_region_is_found(low: float | None, high: float | None) -> None:
    """A mismatch that sits above, below or between values of a reading, to five percent; one that
    is everywhere has no region, nor has none at all."""
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
    """Two spans of time; none for what is always there, or nowhere."""
    time = np.arange(float(N))

    def course(*spans: tuple[int, int]) -> Array:
        values = np.full(N, 0.01)
        for a, b in spans:
            values[a:b] = 1.0
        return values

    found = periods_of(time, course((50, 100), (300, 350)))
    assert np.allclose([(50, 100), (300, 350)], found, atol=5)
    for none in (course((0, N)), np.zeros(N), np.full(N, np.nan)):
        assert () == periods_of(time, none)


@pytest.mark.parametrize("plant", ["alone", "abc"])
def test_predictions_solve_the_residual(plant: str) -> None:
    """The predicted reading is that of the simulation where readings are free of noise."""
    where = alone() if plant == "alone" else opened(plant)
    found = rows_at(where, recorded(where, tour(where[0], 240), seed=None)).system
    predictor = predictors_for(found, tuple(o.id for o in found.observers), frozenset())[0]
    assert not predictor.signal.is_input
    predicted, judged = predictor.predicted(Configuration()), predictor.points
    measured = found.data.values[predictor.signal.id]
    assert measured[judged] == pytest.approx(predicted[judged], rel=1e-9)


def test_predictions_are_off_by_the_noise() -> None:
    """Measured less predicted scatters as the readings' noise says. Where a law has no value
    nothing is predicted: the reading itself, from which the search begins, would count as without
    error."""
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


def test_a_place_of_flow_is_told_by_a_flow_meter_if_there_is_one() -> None:
    """Else by another reading of the residuals that the place moves; no set value is predicted, and
    nothing where pressures make no sense."""
    system = plain().rows.system
    found = predictors_for(system, ("A.pump", "A.power"), frozenset({"A.T"}), "l/h")[0]
    assert {"A.pump", "A.power"} & {t.observer for t in found.residual.terms}
    assert found.signal.id in ("A.dp", "A.P_el")
    assert not found.of_flow
    assert [] == predictors_for(system, (), frozenset())
    broken = changed(recorded(alone(), tour(alone()[0], 60)), {"A.dp": np.full(60, 1.0)})
    assert [] == predictors_for(rows_at(alone(), broken).system, ("A.plant",), frozenset())
