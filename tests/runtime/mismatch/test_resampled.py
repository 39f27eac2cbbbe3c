"""Probabilities of sets over draws of weights: what one part of a recording decides is not sure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from rulec.mismatch.search.settled.resampled import Names, shares
from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.states import states_of
from rulec.mismatch.search.settled.refit import Model
from rulec.mismatch.search.settled.sets import Posterior, explain
from rulec.prove.truth.settled.plan import Planned
from tests.runtime.mismatch.made import rows_at

BETTER, WORSE = frozenset[str](), frozenset({"worse"})


def share_of_worse(found: Posterior, rows: NDArray[np.bool_], nats: float) -> float:
    """The share of a model that loses so many nats because of some rows."""
    plain = replace(found.models[BETTER], table=found.models[BETTER].table[:, :0])
    plain = replace(plain, at=np.zeros(0), left=np.zeros_like(plain.left))
    plain = replace(plain, precision=np.zeros((0, 0)))
    models: dict[Names, Model] = {BETTER: plain}
    low, high = 0.0, 100.0
    for _ in range(60):
        by = 0.5 * (low + high)
        models[WORSE] = replace(plain, left=np.where(rows, by * plain.scale, 0.0))
        lost = float(np.sum(found.geometry.lost(models[WORSE].left, plain.scale)))
        lost -= float(np.sum(found.geometry.lost(plain.left, plain.scale)))
        low, high = (by, high) if lost < nats else (low, by)
    return shares(found.geometry, models, {BETTER: 0.0, WORSE: -nats})[WORSE]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Posterior:
    """A small clean case of the independent truth."""
    folder = tmp_path_factory.mktemp("clean")
    case = Planned("a case", "clean", "dosing", "steps", (), 3000.0, small=True)
    case.make().write(folder)
    opened = open_builder(folder / "plant")
    rows = rows_at(opened, read_recording(folder / "recording.csv", opened[0]))
    return explain(rows, lambda text: None)


def test_nothing_is_named_in_a_clean_recording(found: Posterior) -> None:
    assert found.nothing > 0.9
    assert found.told == frozenset()


def test_a_lead_that_one_operating_state_gives_is_less_sure(found: Posterior) -> None:
    """Of two leads of 6 nats, the one spread over all states keeps nearly all of its odds.

    With an exponential weight w on all of a lead L, the mean of 1 / (1 + exp(w L)) is near
    log(2) / L in the draws of states, which are half of all.
    """
    states = states_of(found.geometry.rows.system, limits.FORM_LENGTH)[found.geometry.point]
    largest = int(np.argmax(np.bincount(states)))
    one = share_of_worse(found, states == largest, 6.0)
    every = share_of_worse(found, states >= 0, 6.0)
    assert len(np.unique(states)) > 3
    assert every < 0.01
    assert 0.25 * np.log(2.0) / 6.0 < one < np.log(2.0) / 6.0


def test_shares_are_those_of_the_odds_where_models_err_alike(found: Posterior) -> None:
    """Weights change all sets alike then."""
    models = {BETTER: found.models[BETTER], WORSE: found.models[BETTER]}
    share = shares(found.geometry, models, {BETTER: 0.0, WORSE: -2.0})
    assert abs(share[WORSE] / share[BETTER] - np.exp(-2.0)) < 1e-9
    assert abs(sum(share.values()) - 1.0) < 1e-9
