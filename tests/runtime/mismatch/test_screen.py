"""One linear step per candidate: what is planted gains most, and nothing gains without a cause."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    columns_of,
    score_tests_at,
    screen,
    with_open_references,
)
from tests.runtime.mismatch.made import USUAL, Built, Sure, alone, recorded, rows_at, tour, warming
from tests.runtime.mismatch.warm import joined

SAMPLES = 240
SLIP = "A.slip-temperature@Q_geo"
PLANTED: dict[str, Built] = {
    "A.slip-temperature@Q_geo": {"A.slip-temperature@Q_geo": {"b": 0.03, "T0": USUAL}},
    "A.relief-valve@Q_geo": {"A.relief-valve@Q_geo": {"K": 150e-3 / 3600 / 1e5, "p_open": 1.9e5}},
    "A.zero-drift-temperature@dp": {"A.zero-drift-temperature@dp": {"z": 400.0, "T0": USUAL}},
}


@functools.cache
def plain(name: str) -> Fitted:
    """The plain model refitted to a recording with something built in."""
    rules, _ = alone()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    rows = rows_at(alone(), recorded(alone(), given, PLANTED.get(name, {})))
    return fit(rows, Configuration(), rows.system.data.open)


@functools.cache
def trials(name: str) -> tuple[InitialCandidate, ...]:
    return tuple(screen(plain(name), alone()[1].candidates))


@pytest.mark.parametrize("name", PLANTED)
def test_the_planted_effect_gains_among_the_most(name: str) -> None:
    """It is among the five that are refitted in full, far above the bulk."""
    found = {t.candidate.id: t.gain for t in trials(name)}
    assert name in list(found)[:5]
    assert found[name] > 20.0
    assert found[name] > 5.0 * float(np.median(list(found.values())))


@pytest.mark.parametrize("name", PLANTED)
def test_the_first_guess_is_near_the_truth(name: str) -> None:
    """Amplitudes by projection have the right sign and size, to a factor of three."""
    trial = next(t for t in trials(name) if t.candidate.id == name)
    amplitude = next(u for u in trial.candidate.unknowns if u.null is not None)
    true = PLANTED[name][name][amplitude.name]
    assert 1 / 3 < trial.values[amplitude.id] / float(np.max(true)) < 3


def test_sets_of_terms_gain_what_each_gains_alone() -> None:
    """All pairs at once are what they are one by one, within the ends of their ranges."""
    fitted = plain("A.slip-temperature@Q_geo")
    look = score_tests_at(fitted)[0]
    columns = [columns_of(fitted, t.candidate, t.values, t.fixed) for t in trials("healthy")[:6]]
    table = np.concatenate([c for c in columns if c is not None], axis=1)
    n = table.shape[1]
    sets = np.array(list(itertools.combinations(range(n), 2)))
    low, high = np.full(n, -np.inf), np.linspace(0.0, 1.0, n)
    amplitudes, gains = look.best_of(table, sets, low, high)
    for pair, amplitude, gain in zip(sets, amplitudes, gains, strict=True):
        alone_, own = look.best(table[:, pair], low[pair], high[pair])
        np.testing.assert_allclose(amplitude, alone_, rtol=1e-7, atol=1e-300)
        assert gain == pytest.approx(own, rel=1e-9)


def test_nothing_gains_on_a_healthy_recording() -> None:
    """Some 40 candidates fit noise: none by more than chance, 8 in log likelihood."""
    assert max(t.gain for t in trials("healthy")) < 8.0


def test_trials_are_sorted_and_within_their_range() -> None:
    """Best first; every start is legal and references are those of open points."""
    found = trials("A.slip-temperature@Q_geo")
    gains = [t.gain for t in found]
    assert sorted(gains, reverse=True) == gains
    assert min(gains) > 0
    for trial in found:
        for unknown in trial.candidate.unknowns:
            if unknown.id in trial.values:
                assert unknown.lowest <= trial.values[unknown.id] <= unknown.highest
    slip = next(t for t in found if t.candidate.name == "slip-temperature")
    data = plain("A.slip-temperature@Q_geo").rows.system.data
    expected = float(np.median(data.values["A.T"][data.open]))
    assert {f"{slip.candidate.id}.T0": expected} == slip.fixed


def test_a_driver_that_is_not_recorded_makes_no_trial() -> None:
    """No candidate that needs a level is tried: none was recorded."""
    tried = {d for t in trials("healthy") for d in t.candidate.drivers.values()}
    assert "A.l" not in tried
    assert any("A.l" in c.drivers.values() for c in alone()[1].candidates)


def test_where_the_plain_law_holds_may_be_searched_for() -> None:
    """The temperature at which the slip is the plain one is open; a median load is only a unit."""
    system = plain("healthy").rows.system
    by_id = {t.candidate.id: t for t in trials("A.slip-temperature@Q_geo")}
    opened_ = with_open_references(system, by_id["A.slip-temperature@Q_geo"])
    assert opened_ is not None
    (free,) = (u for u in opened_.candidate.unknowns if u.name == "T0")
    values = system.data.values["A.T"]
    assert not free.fixed
    assert (free.unit, free.offset) == ("degC", 273.15)
    assert free.lowest < values.min() < opened_.values[free.id] < values.max() < free.highest
    assert not opened_.fixed
    (unit,) = (t for n, t in by_id.items() if n == "A.bypass-flow@Q_geo")
    assert with_open_references(system, unit) is None


def test_a_calibration_at_another_temperature_bends_no_law() -> None:
    """The plain law holds at 20 degC, and is known well; the recording is warmer by far."""
    rules, builder = alone()
    known = builder.parameters
    sure = replace(known, covariance=known.covariance * 1e-4)
    there = rules, Sure(builder, sure)
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    rows = rows_at(there, recorded(alone(), given, PLANTED[SLIP]))
    begun = fit(rows, Configuration(), rows.system.data.open)
    (trial,) = (t for t in screen(begun, builder.candidates) if t.candidate.id == SLIP)
    elsewhere = with_open_references(begun.rows.system, trial)
    assert elsewhere is not None
    fitted = joined(begun, elsewhere)
    b, usual = f"{SLIP}.b", f"{SLIP}.T0"
    assert abs(fitted.setting.values[b] - 0.03) < 3.0 * fitted.u(b)
    assert abs(fitted.setting.values[usual] - USUAL) < 3.0 * fitted.u(usual)
