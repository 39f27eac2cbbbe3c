"""What the independent truth conceals and the search once took for something else."""

from __future__ import annotations

from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.analyse import analyse
from rulec.mismatch.search.operating_states import search
from rulec.prove.truth.settled.plan import Planned, SettledCase
from tests.runtime.mismatch.made import rows_at

pytestmark = pytest.mark.prove


def case(effect: str, aim: float = 3000.0) -> SettledCase:
    """Two pumps and a mixer, driven by steps."""
    return Planned(f"concealed {effect}", "single", "dosing", "steps", (effect,), aim).make()


def opened(made: SettledCase, folder: Path) -> tuple[Recording, Ruleset, ModelBuilder]:
    """A case from its files alone."""
    made.write(folder)
    ruleset, builder = open_builder(folder / "plant")
    return read_recording(folder / "recording.csv", ruleset), ruleset, builder


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
    """First, and in its module."""
    made = case(effect)
    found = analyse(*opened(made, tmp_path))
    module = made.answer.effects[0].module
    assert verdict == found.verdict
    assert [(name, module)] == [(f.name, f.module) for f in found.findings]


def test_two_of_which_each_imitates_the_other_for_a_while(tmp_path: Path) -> None:
    """Each alone gains in some blocks and does harm in others; both are found at once, or one of
    them with another that gives way to the second."""
    name, effects = "stationary-718873036-pair-fouling+leak-0", ("fouling", "leak")
    made = Planned(name, "pair", "dosing", "ramps", effects, 4241.729764785293).make()
    recording, ruleset, builder = opened(made, tmp_path)
    found = search(rows_at((ruleset, builder), recording), lambda text: None)
    told = {a.candidate.name: a.candidate.module for a in found.accepted}
    assert {"leakage": "B", "fouling": "B"} == told
    assert all(a.probability > 0.9 for a in found.accepted)


def test_what_no_entry_names_is_not_named(tmp_path: Path) -> None:
    """A frame that shakes in a band of speeds takes power; docs/repair-a-model.md has another."""
    made = case("resonance", 8000.0)
    found = analyse(*opened(made, tmp_path))
    assert "unnamed" == found.verdict
    (planted,) = made.answer.effects
    assert found.locations[0].module == planted.module
    assert f"{planted.module}.{found.locations[0].place}" in planted.places
