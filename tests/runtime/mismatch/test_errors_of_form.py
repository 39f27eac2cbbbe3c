"""Errors of form: each law has its own size, and none explains the noise of a reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import screen
from rulec.mismatch.search.refit import refitted
from rulec.mismatch.search.settled.best_set import reported_names
from rulec.mismatch.search.settled.effect_forms import forms_of_effects
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.settled.sets import explain
from tests.runtime.mismatch.made import alone, recorded, rows_at, tour, warming

SAMPLES = 240


def with_copper_loss() -> Fitted:
    """A recording with an effect that follows two outputs, refitted with it."""
    rules, _ = alone()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    loss = {"A.copper-loss@P_law": {"k": 0.05, "dp0": 1.5e5, "P0": 150.0}}
    rows = rows_at(alone(), recorded(alone(), given, loss))
    clean = fit(rows, Configuration(), rows.system.data.open)
    (trial,) = screen(clean, [c for c in alone()[1].candidates if c.id in loss])
    setting = clean.setting.joining(trial.candidate, trial.values, trial.fixed, trial.course)
    return fit(rows, setting, rows.system.data.open)


def test_an_effects_error_of_form_does_not_follow_the_noise_of_what_drives_it() -> None:
    """Over a reading that the model predicts, a bend would be a second guess of each error."""
    there = with_copper_loss()
    geometry = Geometry(there.rows)
    columns = forms_of_effects(there.rows, geometry.seen, there)
    values = dict(there.rows.system.data.values)
    assert np.abs(columns).max() > 1.0
    for name in ("A.dp", "A.P_el"):
        noise = np.random.default_rng(1).standard_normal(len(values[name]))
        values[name] = values[name] * (1.0 + 0.01 * noise)
    data = there.rows.system.data
    noisy = replace(data, points=replace(data.points, values=values))
    rows = replace(there.rows, system=replace(there.rows.system, data=noisy))
    again = forms_of_effects(rows, geometry.seen, there)
    np.testing.assert_allclose(again, columns, rtol=1e-9, atol=1e-12 * np.abs(columns).max())


def test_one_law_may_be_off_by_more_than_the_others() -> None:
    """A bend in the power law is an error of that law, not of all."""
    rules, _ = alone()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    recording = recorded(alone(), given, {})
    speed = recording.values["A.n"]
    turn = (speed - speed.min()) / np.ptp(speed)
    bent = recording.values["A.P_el"] * (1.0 + 0.06 * np.sin(2.0 * np.pi * turn))
    rows = rows_at(alone(), replace(recording, values={**recording.values, "A.P_el": bent}))
    laws = refitted(Geometry(rows), Configuration()).sizes.laws
    assert laws["definition:A.P_law"] > 1.5 * max(laws[n] for n in laws if "P_law" not in n)


@pytest.mark.parametrize(("reading", "told"), [("A.P_el", False), ("A.dp", True)])
def test_a_law_off_by_no_more_than_its_accuracy_misses_nothing(reading: str, told: bool) -> None:
    """A ripple of 3 % is what the law of the power may be off by, and more than that of the line
    may: only there something without a name is told."""
    rules, _ = alone()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    recording = recorded(alone(), given, {})
    speed = recording.values["A.n"]
    turn = (speed - speed.min()) / np.ptp(speed)
    values = recording.values[reading] * (1.0 + 0.03 * np.sin(6.0 * np.pi * turn))
    rows = rows_at(alone(), replace(recording, values={**recording.values, reading: values}))
    found = explain(rows, lambda said: None)
    assert {f"signal:{reading}~A.n"} == found.told
    assert told == bool(reported_names(found))
    assert found.unseen < 0.1 if told else found.unseen > 0.9
