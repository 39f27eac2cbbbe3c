"""What the independent truth conceals and the search once took for something else."""

from dataclasses import replace
from math import comb
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.analyse import analyse
from rulec.mismatch.answer.verdict import next_step
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.term import Switching
from rulec.mismatch.search.grow_sets import join_terms
from rulec.mismatch.search.later_refits import possible_sets, refitted_again
from rulec.mismatch.search.operating_states import begun, explain, search
from rulec.mismatch.search.posterior import Posterior
from rulec.mismatch.search.time_course import price
from rulec.prove.truth.settled.plan import Planned, SettledCase
from tests.runtime.mismatch.made import rows_at
from tests.runtime.mismatches import UNNAMED


def case(effect: str, aim: float = 3000.0) -> SettledCase:
    return Planned(f"concealed {effect}", "single", "dosing", "steps", (effect,), aim).make()


def opened(made: SettledCase, folder: Path) -> tuple[Recording, Ruleset, ModelBuilder]:
    made.write(folder)
    ruleset, builder = open_builder(folder / "plant")
    return read_recording(folder / "recording.csv", ruleset), ruleset, builder


@pytest.mark.prove
@pytest.mark.parametrize(
    ("effect", "verdict", "name"),
    [
        ("leak", "fault", "leakage"),  # it may be there for longer than it is not
        ("clogged", "fault", "clogging"),  # a driver may turn about when it begins
        ("slip-laminar", "named", "slip-linear"),  # more than stated values can make room for
        ("wear", "named", "wear-slip"),  # a time constant that is not needed
        ("power-gain-creep", "sensor", "gain-drift-time"),  # a course that only bends as much
    ],
)
def test_what_was_planted_is_named(effect: str, verdict: str, name: str, tmp_path: Path) -> None:
    made = case(effect)
    found = analyse(*opened(made, tmp_path))
    module = made.answer.effects[0].module
    assert verdict == found.verdict
    assert [(name, module)] == [(f.name, f.module) for f in found.findings]


@pytest.mark.prove
def test_two_of_which_each_imitates_the_other_for_a_while(tmp_path: Path) -> None:
    """Each alone gains in some blocks and does harm in others."""
    name, effects = "stationary-718873036-pair-fouling+leak-0", ("fouling", "leak")
    made = Planned(name, "pair", "dosing", "ramps", effects, 4241.729764785293).make()
    recording, ruleset, builder = opened(made, tmp_path)
    found = search(rows_at((ruleset, builder), recording), lambda text: None)
    told = {a.candidate.name: a.candidate.module for a in found.accepted}
    assert {"leakage": "B", "fouling": "B"} == told
    assert all(a.probability > 0.9 for a in found.accepted)


@pytest.mark.prove
def test_what_no_entry_names_is_not_named(tmp_path: Path) -> None:
    """A frame that shakes in a band of speeds takes power; docs/repair-a-model.md has another."""
    made = case("resonance", 8000.0)
    found = analyse(*opened(made, tmp_path))
    assert "unnamed" == found.verdict
    (planted,) = made.answer.effects
    assert found.locations[0].module == planted.module
    assert f"{planted.module}.{found.locations[0].place}" in planted.places


def rows_of(group: str, effect: str, folder: Path) -> Rows:
    """A small case with one effect that no entry has, or whose driver is not recorded."""
    Planned("a case", group, "dosing", "steps", (effect,), 3000.0, small=True).make().write(folder)
    opened = open_builder(folder / "plant")
    return rows_at(opened, read_recording(folder / "recording.csv", opened[0]))


def with_terms(rows: Rows, place: str) -> Posterior:
    search = begun(rows)
    spots = {s.id for s in rows.system.builder.spots if f"{s.module}.{s.place}" == place}
    every = search.evidence.terms(search.models[frozenset()].point)
    join_terms(search, frozenset(), [t for t in every if t.spot in spots])
    return search.posterior()


def share(found: Posterior, mark: str) -> float:
    """Probability that a set has a name with some mark."""
    return sum(p for names, p in found.sets.items() if any(mark in name for name in names))


def test_friction_by_the_way_there_is_told_as_that(tmp_path: Path) -> None:
    """No experiment is planned with it: what it does at other set points is unknown."""
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
    found = explain(rows_of(group, effect, tmp_path), lambda text: None)
    assert share(found, "~time") > 0.9
    assert share(found, "!") < 0.1


def test_a_level_lasts_until_the_next_end() -> None:
    """Which of some borders are ends is as dear as telling them."""
    assert price(4, 10) == pytest.approx(np.log(comb(10, 4) * 11))
    way = Switching(np.array([10.0, 20.0]), np.array([0.0, 1.0, -1.0]), "says", 0.0)
    assert way.at(np.array([5.0, 10.0, 19.0, 20.0]))[:, 0].tolist() == [0.0, 1.0, 1.0, -1.0]


def test_who_reads_it_is_sent_to_the_set_points_not_to_a_sensor() -> None:
    said = next_step("unnamed", (), replace(UNNAMED.hidden, switches=True), ())
    assert "from below and from above" in said
    assert "Record what may drive it" not in said
