"""Pairs of faults that are alike at the reference point, and what one step does for them."""

from __future__ import annotations

import numpy as np
import pytest

from rulec.limits import SEPARATED
from rulec.separation.allowed import Allowed, Range, allowed_of
from rulec.separation.distance import Case, FaultMeasure
from rulec.separation.limits import STEP_DEGREES
from rulec.separation.pairs import separate_pairs
from rulec.simulation.equations import equations_of
from tests.conftest import compiled


def test_one_step_tells_all_pairs_of_the_small_plant_apart() -> None:
    pairs = list(separate_pairs(compiled("abc"), allowed_of(compiled("abc"))))
    close = [p for p in pairs if not p.is_apart]
    assert (len(pairs), len(close)) == (16, 10)
    assert all(p.is_split for p in close)
    assert all(not p.proposal.changes for p in pairs if p.is_apart)


def test_nothing_is_proposed_where_nothing_may_be_moved() -> None:
    """Limits so narrow that no point differs clearly from the present one."""
    ruleset = compiled("abc")
    narrow = Range(signal=ruleset.signal_by_id["B.n"], lowest=899, highest=901, rate=1)
    allowed = allowed_of(ruleset, Allowed({"B.n": narrow}, frozenset()))
    first = next(p for p in separate_pairs(ruleset, allowed) if not p.is_apart)
    assert first.proposal.changes == {}
    assert first.proposal.apart == first.proposal.here
    assert not first.is_split


def test_distance_grows_with_the_degree_and_vanishes_for_the_fault_itself() -> None:
    ruleset = compiled("abc")
    equations = equations_of(ruleset)
    a, b = (ruleset.fault_by_id[name] for name in ("A.clogging", "A.dp.high"))
    small, large = STEP_DEGREES
    measure = FaultMeasure(
        equations=equations,
        present={s.id: s.reference for s in equations.given_signals},
        rows=[[Case(a, small, b)], [Case(a, large, b)], [Case(a, large, a)]],
    )
    looked = measure([{}, {"B.n": 540.0}])
    assert looked.apart[0, 0] < looked.apart[1, 0] < SEPARATED
    assert SEPARATED < looked.apart[0, 1] < looked.apart[1, 1]
    assert looked.apart[2] == pytest.approx(np.zeros(2), abs=1e-3)


def test_point_where_a_reading_leaves_its_range_is_impossible() -> None:
    ruleset = compiled("abc")
    equations = equations_of(ruleset)
    a, b = (ruleset.fault_by_id[name] for name in ("A.clogging", "A.dp.high"))
    measure = FaultMeasure(
        equations=equations,
        present={s.id: s.reference for s in equations.given_signals},
        rows=[[Case(a, 0.2, b)]],
    )
    looked = measure([{}, {"A.n": 30.0}])  # below the speed from which on the pump is judged
    assert np.isfinite(looked.apart[0, 0])
    assert np.isnan(looked.apart[0, 1])
