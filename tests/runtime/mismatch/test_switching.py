"""What comes and goes with the set points, or by the way they came, is no fault."""

from __future__ import annotations

from dataclasses import replace
from math import comb
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.answer.verdict import next_step
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.term import Switching
from rulec.mismatch.search.grow_sets import join_terms
from rulec.mismatch.search.later_refits import possible_sets, refitted_again
from rulec.mismatch.search.operating_states import begun, explain
from rulec.mismatch.search.posterior import Posterior
from rulec.mismatch.search.time_course import price
from rulec.prove.truth.settled.plan import Planned
from tests.runtime.mismatch.made import rows_at
from tests.runtime.mismatches import UNNAMED


def rows_of(group: str, effect: str, folder: Path) -> Rows:
    """A small case with one effect that no entry has, or whose driver is not recorded."""
    Planned("a case", group, "dosing", "steps", (effect,), 3000.0, small=True).make().write(folder)
    opened = open_builder(folder / "plant")
    return rows_at(opened, read_recording(folder / "recording.csv", opened[0]))


def with_terms(rows: Rows, place: str) -> Posterior:
    """Terms without a name at a place alone."""
    search = begun(rows)
    spots = {s.id for s in rows.system.builder.spots if f"{s.module}.{s.place}" == place}
    every = search.evidence.terms(search.models[frozenset()].point)
    join_terms(search, frozenset(), [t for t in every if t.spot in spots])
    return search.posterior()


def share(found: Posterior, mark: str) -> float:
    """Probability that a set has a name with some mark."""
    return sum(p for names, p in found.sets.items() if any(mark in name for name in names))


def test_friction_by_the_way_there_is_told_as_that(tmp_path: Path) -> None:
    """Of all terms at the place, the one with memory gains most. No experiment is planned with it:
    what it does at other set points is not known."""
    rows = rows_of("unnamed", "play", tmp_path)
    found = with_terms(rows, "A.loss")
    (term,) = found.models[found.best].terms
    assert "a law with memory" in term.basis.says
    standing = possible_sets(found)
    assert term.basis.says in standing[0].titles[0]
    assert standing[0] not in refitted_again(rows, standing).sets


def test_a_driver_that_turns_is_told_as_a_course(tmp_path: Path) -> None:
    found = with_terms(rows_of("unrecorded", "friction-warm", tmp_path), "A.P_law")
    assert share(found, "~time") > 0.9


@pytest.mark.prove
@pytest.mark.parametrize(
    ("group", "effect"), [("unnamed", "play"), ("unrecorded", "friction-warm")]
)
def test_neither_is_told_as_a_fault(group: str, effect: str, tmp_path: Path) -> None:
    """Faults that come and go are among what is weighed."""
    found = explain(rows_of(group, effect, tmp_path), lambda text: None)
    assert share(found, "~time") > 0.9
    assert share(found, "!") < 0.1


def test_a_level_lasts_until_the_next_end() -> None:
    """Which of some borders are ends is as dear as telling them."""
    assert price(4, 10) == pytest.approx(np.log(comb(10, 4) * 11))
    way = Switching(np.array([10.0, 20.0]), np.array([0.0, 1.0, -1.0]), "says", 0.0)
    assert way.at(np.array([5.0, 10.0, 19.0, 20.0]))[:, 0].tolist() == [0.0, 1.0, 1.0, -1.0]


def test_who_reads_it_is_sent_to_the_set_points_not_to_a_sensor() -> None:
    assert UNNAMED.hidden is not None
    said = next_step("unnamed", (), replace(UNNAMED.hidden, switches=True), ())
    assert "from below and from above" in said
    assert "Record what may drive it" not in said
