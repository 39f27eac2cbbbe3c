"""Refits: true values come back, priors hold, and a few bad points do not bend a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.recordings.recording import Recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.model import model_of
from rulec.mismatch.inference.interval import profile
from tests.runtime.mismatch.made import (
    USUAL,
    Built,
    Sure,
    alone,
    recorded,
    rows_at,
    tour,
    warming,
)

SAMPLES = 240
BAR = 1e5
SLIP = "A.slip-temperature@Q_geo"
TRUE: Built = {SLIP: {"b": 0.03, "T0": USUAL}}


def recording(built: Built | None = None, **how: object) -> Recording:
    rules, _ = alone()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    return recorded(alone(), given, built, **how)  # type: ignore[arg-type]


def joined(name: str, start: Mapping[str, float], fixed: Mapping[str, float]) -> Configuration:
    """The plain model with a candidate in it."""
    candidate = next(c for c in alone()[1].candidates if c.id == name)
    return Configuration().joining(
        candidate,
        {f"{name}.{k}": v for k, v in start.items()},
        {f"{name}.{k}": v for k, v in fixed.items()},
    )


def fitted(of: Recording, setting: Configuration | None = None) -> Fitted:
    rows = rows_at(alone(), of)
    return fit(rows, setting or Configuration(), rows.system.data.open)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_planted_value_is_found(seed: int) -> None:
    """The rise of the slip per kelvin, within three standard uncertainties and 20 %."""
    found = fitted(recording(TRUE, seed=seed), joined(SLIP, {"b": 0.01}, {"T0": USUAL}))
    value, u = found.setting.values[f"{SLIP}.b"], found.u(f"{SLIP}.b")
    assert abs(value - 0.03) < 3 * u
    assert u < 0.2 * 0.03


def test_without_noise_the_value_is_exact() -> None:
    """Nothing pulls, so the true values are the best ones."""
    found = fitted(recording(TRUE, seed=None), joined(SLIP, {"b": 0.01}, {"T0": USUAL}))
    assert 0.03 == pytest.approx(found.setting.values[f"{SLIP}.b"], rel=1e-3)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_base_values_come_back(seed: int) -> None:
    """True parameters are drawn from what is stated: the refit errs as its covariance says."""
    _, builder = alone()
    known = builder.parameters
    found = fitted(recording(seed=seed))
    draw = np.random.default_rng(seed + 1000).multivariate_normal(
        known.values, known.covariance, method="eigh"
    )
    pulls = [
        (found.setting.values[n] - true) / found.u(n)
        for n, true in zip(known.ids, draw, strict=True)
        if n in found.prior.names
    ]
    assert float(np.max(np.abs(pulls))) < 3.5
    assert 0.6 < found.scale < 1.2


def test_the_prior_holds_where_nothing_is_said() -> None:
    """One operating point does not tell parameters apart: they stay where they were stated."""
    rules, builder = alone()
    given = {"A.n": np.full(60, rules.signal_by_id["A.n"].reference)}
    found = fitted(recorded(alone(), given, moved=False))
    u = np.sqrt(np.diag(builder.parameters.covariance))
    off = [
        abs(found.setting.values[n] - v) / s
        for n, v, s in zip(builder.parameters.ids, builder.parameters.values, u, strict=True)
        if s > 0
    ]
    assert max(off) < 1.5
    assert all(found.u(n) < 1.001 * s for n, s in zip(builder.parameters.ids, u, strict=True) if s)


def test_held_values_stay() -> None:
    """A value that is held is where it was put, and the others still move."""
    rows = rows_at(alone(), recording(TRUE))
    found = fit(
        rows, Configuration(), rows.system.data.open, held={"A.C2": 1e-17, ERROR + "A.dp": 0.5}
    )
    assert found.setting.values["A.C2"] == pytest.approx(1e-17)
    assert 0.5 == found.setting.values[ERROR + "A.dp"]
    assert found.setting.values["A.C0"] != alone()[1].parameters.values[0]


def test_values_stay_within_their_range() -> None:
    """A share that cannot be negative ends at its bound."""
    found = fitted(recording(), joined("A.relief-valve@Q_geo", {"K": 1e-12, "p_open": 3e5}, {}))
    lowest = dict(zip(found.prior.names, found.prior.lowest, strict=True))
    for name, value in found.setting.values.items():
        if name in lowest:
            assert value >= lowest[name], name


@pytest.mark.parametrize("size", [3.0, 30.0])
def test_gross_errors_do_not_bend_the_model(size: float) -> None:
    """Every tenth pressure reading is wrong by a share of the range; the value is still found."""
    clean = recording(TRUE)
    draw = np.random.default_rng(8)
    wrong = draw.random(SAMPLES) < 0.1
    # Bad for three samples at a time, so that averages over points do not thin them out.
    shift = np.where(wrong, size * 0.01e5, 0.0)
    values = {**clean.values, "A.dp": clean.values["A.dp"] + shift}
    setting = joined(SLIP, {"b": 0.01}, {"T0": USUAL})
    found, plain = fitted(replace(clean, values=values), setting), fitted(clean, setting)
    name = f"{SLIP}.b"
    assert abs(found.setting.values[name] - 0.03) < 3 * found.u(name)
    assert found.u(name) < 2.5 * plain.u(name)


def test_the_profile_is_about_two_standard_uncertainties_wide() -> None:
    """For a value in which the model is nearly linear; the best value lies inside."""
    found = fitted(recording(TRUE), joined(SLIP, {"b": 0.01}, {"T0": USUAL}))
    name = f"{SLIP}.b"
    low, high = profile(model_of(found).line(name))
    assert low < found.setting.values[name] < high
    assert 3.92 * found.u(name) == pytest.approx(high - low, rel=0.25)


def test_a_bent_valley_is_followed_to_its_end() -> None:
    """Gaps that widen: from the plain model to the true one, slip and its rise go along a curve.

    With damping by fixed factors a fit ended after 20 steps at a seventh of the true value.
    """
    plant = open_builder(Path(__file__).parent / "oil.yaml")
    name, true = "main.slip-clearance@Q_law", 2e-3 / BAR
    given = {"main.dp": BAR * (124.0 + 43.0 * np.mod(np.arange(600) // 12 * 0.618, 1.0))}
    rows = rows_at(plant, recorded(plant, given, {name: {"c": true}}, moved=False))
    candidate = next(c for c in plant[1].candidates if c.id == name)
    plain = fit(rows, Configuration(), rows.system.data.open)
    begun = plain.setting.joining(candidate, {f"{name}.c": 0.01 * true}, {})
    found = fit(rows, begun, rows.system.data.open)
    assert found.setting.values[f"{name}.c"] == pytest.approx(true, rel=0.05)


def test_a_sheet_gives_way_and_still_counts() -> None:
    """Where a recording shows another value, it is found; how far the sheet is off is counted."""
    rules, builder = alone()
    known = builder.parameters
    i, far = known.ids.index("A.eta"), 0.1
    values, covariance = known.values.copy(), np.diag(np.diag(known.covariance))
    values[i], covariance[i, i] = known.values[i] - far, 0.005**2
    sheet = {**known.sheet, "A.eta": (values[i], 0.005)}
    doubted = replace(known, values=values, covariance=covariance, sheet=sheet)
    there = rules, Sure(builder, doubted)
    rows = rows_at(there, recorded(alone(), tour(rules, SAMPLES), moved=False))  # type: ignore[arg-type]
    found = fit(rows, Configuration(), rows.system.data.open)
    assert found.setting.values["A.eta"] == pytest.approx(known.values[i], abs=0.02)
    assert found.negative_log_prior > 5.0


def test_positive_values_stay_positive() -> None:
    """Nothing changes its sign, however far a recording pulls."""
    found = fitted(recording({SLIP: {"b": -0.03, "T0": USUAL}}))
    positive = [
        n for n, p in zip(found.prior.names, found.prior.coordinates.positive, strict=True) if p
    ]
    assert "A.C2" in positive
    assert all(found.setting.values[n] > 0.0 for n in positive)


def test_where_a_law_has_no_value_it_is_not_right() -> None:
    """A reading of which nothing is left has no flow: there is nothing that could be wrong."""
    there = alone()
    rows = rows_at(there, recorded(there, tour(there[0], SAMPLES), moved=False))
    slope = next(c for c in there[1].candidates if c.id == "A.dp.low")
    (share,) = slope.unknowns
    nothing = Configuration().joining(slope, {share.id: 1.0}, {})
    assert fit(rows, nothing, rows.system.data.open, steps=0).objective == np.inf
