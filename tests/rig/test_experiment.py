"""The experiment on names by evidence: one case with something left out, one without."""

from __future__ import annotations

from pathlib import Path

from rulec.prove.truth.settled import suite
from tests.rig.experiment.__main__ import COUNTS, answer
from tests.rig.experiment.search import Posterior


def asked(name: str, folder: Path) -> Posterior | None:
    """A case of seed 7 whose name holds a word."""
    case = next(c for c in suite.planned(7, COUNTS, True) if name in c.name)
    case.make().write(folder)
    return answer(folder / "plant", folder / "recording.csv")


def test_nothing_is_named_in_a_clean_recording(tmp_path: Path) -> None:
    found = asked("clean", tmp_path)
    assert found is not None
    assert found.nothing > 0.9


def test_what_was_left_out_is_named(tmp_path: Path) -> None:
    """Probabilities of sets add up to those of names."""
    found = asked("valve-delay", tmp_path)
    assert found is not None
    assert found.names["B.valve-delay@Q_geo"] > 0.9
    assert abs(sum(found.sets.values()) - 1.0) < 1e-9
