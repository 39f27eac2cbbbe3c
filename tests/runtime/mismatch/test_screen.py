"""One linear step per candidate: what is planted gains most, and nothing gains without a cause."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    columns_of,
    score_tests_at,
    screen,
    with_open_references,
)
from tests.runtime.mismatch.made import SLIP, USUAL, Built, Sure, alone, fitted, joined, warmed

PLANTED: Built = {
    SLIP: {"b": 0.03, "T0": USUAL},
    "A.relief-valve@Q_geo": {"K": 150e-3 / 3600 / 1e5, "p_open": 1.9e5},
    "A.zero-drift-temperature@dp": {"z": 400.0, "T0": USUAL},
}


@functools.cache
def plain(name: str) -> Fitted:
    """The plain model refitted to a recording with something built in."""
    return fitted(alone(), warmed({name: PLANTED[name]} if name in PLANTED else {}))


@functools.cache
def trials(name: str) -> dict[str, InitialCandidate]:
    return {t.candidate.id: t for t in screen(plain(name), alone()[1].candidates)}


@pytest.mark.parametrize("name", PLANTED)
def test_the_planted_effect_gains_among_the_most(name: str) -> None:
    """It is among the five that are refitted in full, far above the bulk, and its amplitude by
    projection has the right sign and size, to a factor of three."""
    gains = {n: t.gain for n, t in trials(name).items()}
    assert name in list(gains)[:5]
    assert gains[name] > max(20.0, 5.0 * float(np.median(list(gains.values()))))
    trial = trials(name)[name]
    amplitude = next(u for u in trial.candidate.unknowns if u.null is not None)
    true = PLANTED[name][amplitude.name]
    assert 1 / 3 < trial.values[amplitude.id] / float(np.max(true)) < 3


def test_sets_of_terms_gain_what_each_gains_alone() -> None:
    """All pairs at once are what they are one by one, within the ends of their ranges."""
    own = plain(SLIP)
    look = score_tests_at(own)[0]
    tried = list(trials("healthy").values())[:6]
    columns = [columns_of(own, t.candidate, t.values, t.fixed) for t in tried]
    table = np.concatenate([c for c in columns if c is not None], axis=1)
    n = table.shape[1]
    sets = np.array(list(itertools.combinations(range(n), 2)))
    low, high = np.full(n, -np.inf), np.linspace(0.0, 1.0, n)
    amplitudes, gains = look.best_of(table, sets, low, high)
    for pair, amplitude, gain in zip(sets, amplitudes, gains, strict=True):
        one, alone_ = look.best(table[:, pair], low[pair], high[pair])
        np.testing.assert_allclose(amplitude, one, rtol=1e-7, atol=1e-300)
        assert gain == pytest.approx(alone_, rel=1e-9)


def test_nothing_gains_on_a_healthy_recording() -> None:
    """Some 40 candidates fit noise: none by more than chance, 8 in log likelihood. None is tried
    that needs a level, which was not recorded."""
    found = trials("healthy").values()
    assert max(t.gain for t in found) < 8.0
    assert "A.l" not in {d for t in found for d in t.candidate.drivers.values()}
    assert any("A.l" in c.drivers.values() for c in alone()[1].candidates)


def test_trials_are_sorted_and_within_their_range() -> None:
    """Best first; every start is legal and references are those of open points."""
    found = trials(SLIP)
    gains = [t.gain for t in found.values()]
    assert sorted(gains, reverse=True) == gains
    assert min(gains) > 0
    for trial in found.values():
        for unknown in trial.candidate.unknowns:
            if unknown.id in trial.values:
                assert unknown.lowest <= trial.values[unknown.id] <= unknown.highest
    data = plain(SLIP).rows.system.data
    expected = float(np.median(data.values["A.T"][data.open]))
    assert {f"{SLIP}.T0": expected} == found[SLIP].fixed


def test_where_the_plain_law_holds_may_be_searched_for() -> None:
    """The temperature at which the slip is the plain one is open; a median load is only a unit."""
    system = plain("healthy").rows.system
    found = with_open_references(system, trials(SLIP)[SLIP])
    assert found is not None
    (free,) = (u for u in found.candidate.unknowns if u.name == "T0")
    values = system.data.values["A.T"]
    assert (False, "degC", 273.15) == (free.fixed, free.unit, free.offset)
    assert free.lowest < values.min() < found.values[free.id] < values.max() < free.highest
    assert not found.fixed
    assert with_open_references(system, trials(SLIP)["A.bypass-flow@Q_geo"]) is None


def test_a_calibration_at_another_temperature_bends_no_law() -> None:
    """The plain law holds at 20 degC, and is known well; the recording is warmer by far."""
    rules, builder = alone()
    known = builder.parameters
    sure = Sure(builder, replace(known, covariance=known.covariance * 1e-4))
    begun = fitted((rules, sure), warmed({SLIP: PLANTED[SLIP]}))  # type: ignore[arg-type]
    (trial,) = (t for t in screen(begun, builder.candidates) if t.candidate.id == SLIP)
    elsewhere = with_open_references(begun.rows.system, trial)
    assert elsewhere is not None
    found = joined(begun, elsewhere)
    for name, true in (("b", 0.03), ("T0", USUAL)):
        own = f"{SLIP}.{name}"
        assert abs(found.setting.values[own] - true) < 3.0 * found.u(own)
