"""Errors of form: each law has its own size, and none explains the noise of a reading."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rulec.mismatch import stores
from rulec.mismatch.analyse import analyse
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import climbed
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, errors_of_effects
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import screen
from rulec.mismatch.search.operating_states import explain
from rulec.mismatch.search.posterior import reported_names
from rulec.mismatch.search.refit import refitted
from tests.runtime.mismatch.dynamic.benches import made, tanks
from tests.runtime.mismatch.made import alone, changed, fitted, joined, rows_at, warmed


def rippled(reading: str, share: float, waves: float) -> Rows:
    """A healthy recording with a ripple over the speed in one reading."""
    recording = warmed()
    speed = recording.values["A.n"]
    turn = (speed - speed.min()) / np.ptp(speed)
    ripple = 1.0 + share * np.sin(2.0 * np.pi * waves * turn)
    return rows_at(alone(), changed(recording, {reading: recording.values[reading] * ripple}))


def test_an_effects_error_of_form_does_not_follow_the_noise_of_what_drives_it() -> None:
    """Over a predicted reading a bend would be a second guess of each error."""
    name = "A.copper-loss@P_law"
    clean = fitted(alone(), warmed({name: {"k": 0.05, "dp0": 1.5e5, "P0": 150.0}}))
    (trial,) = screen(clean, [c for c in alone()[1].candidates if c.id == name])
    there = joined(clean, trial)
    evidence, data = SteadyEvidence(there.rows), there.rows.system.data
    columns = errors_of_effects(there, evidence.seen)
    assert np.abs(columns).max() > 1.0
    noise = 1.0 + 0.01 * np.random.default_rng(1).standard_normal(len(data))
    values = {**data.values, **{n: data.values[n] * noise for n in ("A.dp", "A.P_el")}}
    noisy = replace(data, points=replace(data.points, values=values))
    rows = replace(there.rows, system=replace(there.rows.system, data=noisy))
    again = errors_of_effects(replace(there, rows=rows), evidence.seen)
    np.testing.assert_allclose(again, columns, rtol=1e-9, atol=1e-12 * np.abs(columns).max())


def test_one_law_may_be_off_by_more_than_the_others() -> None:
    evidence = SteadyEvidence(rippled("A.P_el", 0.06, 1.0))
    laws = refitted(evidence, Configuration()).sizes.laws
    assert laws["definition:A.P_law"] > 1.5 * max(laws[n] for n in laws if "P_law" not in n)


@pytest.mark.parametrize(("reading", "told"), [("A.P_el", False), ("A.dp", True)])
def test_a_law_off_by_no_more_than_its_accuracy_misses_nothing(reading: str, told: bool) -> None:
    """3 % is what the law of the power may be off by, and more than that of the line may."""
    found = explain(rippled(reading, 0.03, 3.0), lambda said: None)
    assert {f"signal:{reading}~A.n"} == found.told
    assert told == bool(reported_names(found))
    assert found.unseen < 0.1 if told else found.unseen > 0.9


@pytest.mark.parametrize("fresh", [(), (0, 1)])
def test_a_climb_ends_where_there_are_no_numbers(fresh: tuple[int, ...]) -> None:
    assert climbed(lambda place: np.nan, (1, 1), (3, 3), fresh) in {(1, 1), (0, 0)}
    beside = {(0, 0): 0.0, (1, 0): np.nan, (0, 1): 1.0, (1, 1): 2.0}
    assert climbed(lambda place: beside[place], (0, 1), (2, 2), ()) == (1, 1)


def test_a_refit_without_finite_slopes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    start = fitted(alone(), warmed({}, 120))
    steep = SimpleNamespace(residual=start.residual, jacobian=np.full_like(start.jacobian, np.inf))
    monkeypatch.setattr(SteadyEvidence, "evaluated", lambda *_: steep)
    with pytest.raises(np.linalg.LinAlgError, match="no finite slopes"):
        refitted(SteadyEvidence(start.rows), start.setting)


def test_a_plant_that_runs_away_cannot_be_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    def runs_away(*args: object) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(stores, "search", runs_away)
    found = analyse(made(128), *tanks())
    assert "cannot judge" == found.verdict
    assert "runs away" in found.headline
