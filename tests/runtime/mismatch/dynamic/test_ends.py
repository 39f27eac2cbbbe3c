"""Ends of what a model can say: where it runs away, and where a sensor shows more than stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.simulation.balances import RanAway

from rulec.mismatch.evidence.stores.final_fits import plain_end
from rulec.mismatch.evidence.stores.fit import Fitter
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from tests.runtime.mismatch.dynamic.benches import bench, made


def test_a_model_that_runs_away_is_no_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    """At its end, where errors of sensors are seen anew: it loses, and nothing fails."""
    place = bench(made(200))
    ends, plain = plain_end(place, {})
    candidate = place.candidates[0]

    def away(*_: object, **__: object) -> None:
        raise RanAway

    monkeypatch.setattr(Fitter, "finish", away)
    values = {u.id: (*u.starts, 1.0)[0] for u in candidate.unknowns}
    tried = ends.fitted((candidate,), {**plain.values, **values}, plain)
    assert (candidate,) == tried.joined
    assert ends.gain(tried, plain) < 0.0
    assert ends.polished(plain) is plain


def shown(own: SimulationProblem) -> np.ndarray:
    """What the sensor would show with its zero far below."""
    said = own.simulate((), {**own.plain_values, "lower.y0": -8.0})
    return np.asarray(said.shown["lower.y"])


def test_a_sensor_shows_what_the_recording_proves() -> None:
    """A range that begins at zero ends there, unless readings below zero were recorded."""
    recording = made(200)
    assert float(shown(bench(recording)).min()) == 0.0
    y = recording.values["lower.y"]
    y = y - y.min() - 0.4
    beyond = replace(recording, values={**recording.values, "lower.y": y})
    assert float(shown(bench(beyond)).min()) == pytest.approx(-0.4)
