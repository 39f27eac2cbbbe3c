"""What is told in the end is the diagnosis of the whole, also of a plant that gets glances."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.live import follower, limits
from rulec_runtime.live.follower import concluded, follow, nothing_yet
from rulec_runtime.recordings.recording import Recording, read_recording

from tests.conftest import ROOT, compiled
from tests.rig.follower import plants
from tests.rig.follower.agreement import differences, first_rows, followed
from tests.rig.follower.plants import Planted, part_of, recorded


@functools.cache
def three_lines() -> Ruleset:
    """Three small plants in one file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plants, "LINES", 3)
        return plants.side_by_side()


def with_faults(planted: list[Planted], rows: int = 160) -> Recording:
    """A recording of the three."""
    return recorded(three_lines(), rows, planted, 0.1, np.random.default_rng(2))


LEAK = Planted("L1A.leakage", 0.3, 80, 120)


@pytest.fixture
def glances(monkeypatch: pytest.MonkeyPatch) -> list[list[int]]:
    """Plants count as large; the parts that got each glance."""
    monkeypatch.setattr(limits, "SMALL_PLANT", 5)
    seen: list[list[int]] = []

    def noted(*given: object) -> object:
        seen.append(list(given[3]))  # type: ignore[call-overload]
        return known(*given)  # type: ignore[arg-type]

    known = follower.glance
    monkeypatch.setattr(follower, "glance", noted)
    return seen


@pytest.mark.parametrize(
    ("plant", "name"), [("abc", "leakage_A.csv"), ("abc", "swapped.csv"), ("abc", "warm_A.csv")]
)
def test_examples_agree_row_by_row(plant: str, name: str, glances: list[list[int]]) -> None:
    rules = compiled(plant)
    recording = read_recording(ROOT / "plants" / plant / "examples" / name, rules)
    assert differences(rules, first_rows(recording, 45), 1) == []
    assert glances != []


def test_only_the_part_that_moves_is_judged(glances: list[list[int]]) -> None:
    """Once all rows of a first look have been judged; a fault begins and ends in its part."""
    rules, recording = three_lines(), with_faults([LEAK])
    found = followed(rules, recording, 1)
    told = [(e.what, e.episode.subject) for e in found.events if e.episode.kind == "fault"]
    assert told == [("began", LEAK.fault), ("ended", LEAK.fault)]
    began = next(e for e in found.events if e.what == "began")
    assert began.time - recording.time[LEAK.first] <= 5 * 0.1
    assert {place for places in glances for place in places} <= {0, 1, 2}
    alone = [places for places in glances if places == [1]]
    assert len(alone) > 5
    assert found.diagnosis.findings == diagnose(recording, rules).findings


def test_a_row_that_says_nothing_new_gets_no_look(glances: list[list[int]]) -> None:
    rules, recording = three_lines(), with_faults([])
    memory = nothing_yet(rules, False)
    for first, last in ((0, 100), *((row, row + 1) for row in range(100, 160))):
        for told in follow(rules, memory, part_of(recording, first, last)):
            memory = told.memory
            assert told.events == ()
    assert len(glances) < 10
    assert told.diagnosis.samples == 160
    end = concluded(rules, memory)
    assert end is not None
    assert end.events == ()
    assert concluded(rules, end.memory) is None


def test_a_sensor_that_fails_is_looked_at(glances: list[list[int]]) -> None:
    """A reading that stands still needs a look at everything, which finds it stuck."""
    rules, recording = three_lines(), with_faults([], 240)
    column = recording.values["L2B.dp"].copy()
    column[100:] = column[100]
    recording = replace(recording, values={**recording.values, "L2B.dp": column})
    found = followed(rules, recording, 1)
    assert [s.id for s in diagnose(recording, rules).sensors] == ["L2B.dp.stuck"]
    (stuck,) = [e for e in found.events if e.episode.kind == "sensor"]
    assert (stuck.what, stuck.episode.subject) == ("began", "L2B.dp.stuck")
    assert stuck.time < recording.time[-1] - 5.0
