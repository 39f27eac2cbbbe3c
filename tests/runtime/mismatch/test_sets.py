"""Sets of explanations and their odds: cases with something left out."""

from __future__ import annotations

import pytest
from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.language import expression
from rulec.language.limits import MAX_EQUATION_LENGTH
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.search.settled.best_set import with_term
from rulec.mismatch.search.settled.nameless import terms
from rulec.mismatch.search.settled.sets import Posterior, begun, explain
from tests.conftest import ROOT
from tests.runtime.mismatch.made import USUAL, alone, recorded, rows_at, tour, warming


@pytest.fixture(scope="module")
def left_out() -> Posterior:
    """A recording of a pump whose slip follows the temperature."""
    given = {**tour(alone()[0], 200), "A.T": warming(200)}
    slip = {"A.slip-temperature@Q_geo": {"b": 0.03, "T0": USUAL}}
    return explain(rows_at(alone(), recorded(alone(), given, slip)), lambda text: None)


def test_what_was_left_out_is_named(left_out: Posterior) -> None:
    """Probabilities of sets add up to those of names."""
    named = max(p for name, p in left_out.names.items() if ".slip-temperature@" in name)
    assert named > 0.9
    assert abs(sum(left_out.sets.values()) - 1.0) < 1e-9


def test_a_set_far_behind_stays_there(left_out: Posterior) -> None:
    """That nothing is missing has no chance there."""
    assert left_out.nothing < 1e-6


def test_a_curve_has_fewer_pieces_where_its_equation_is_too_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two curves in one module have longer names, and may pass what an equation may hold."""
    plant = ROOT / "plants" / "abc"
    opened = open_builder(plant)
    recording = read_recording(plant / "examples" / "shaking_B.csv", opened[0])
    start = begun(rows_at(opened, recording))
    every = terms(start.geometry, start.models[frozenset()])
    term = next(t for t in every if t.name == "definition:B.P_law~B.n")
    pieces = []
    for longest in (MAX_EQUATION_LENGTH, MAX_EQUATION_LENGTH * 3 // 4, 10):
        # A new plant: what was built once is kept.
        there = rows_at(
            open_builder(plant), read_recording(plant / "examples" / "shaking_B.csv", opened[0])
        )
        fitted = fit(there, Configuration(), there.system.data.open, 1)
        assert there.system.builder.spots
        monkeypatch.setattr(expression, "MAX_EQUATION_LENGTH", longest)
        joined = with_term(fitted, term)
        monkeypatch.undo()
        added = () if joined is None else joined.setting.joined[-1].unknowns
        pieces.append(sum(u.null is not None for u in added))
    assert pieces[0] > pieces[1] > pieces[2] == 0
