"""Sets of explanations and their odds: cases with something left out, and one without."""

from __future__ import annotations

from pathlib import Path

from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.search.settled.sets import Posterior, explain
from rulec.mismatch.search.settled.told import search
from rulec.prove.truth.settled.plan import Planned
from tests.conftest import ROOT
from tests.runtime.mismatch.made import rows_at


def asked(effects: tuple[str, ...], folder: Path) -> Posterior:
    """A small case in which effects are left out."""
    kind = "single" if effects else "clean"
    case = Planned("a case", kind, "dosing", "steps", effects, 3000.0, small=True)
    case.make().write(folder)
    opened = open_builder(folder / "plant")
    rows = rows_at(opened, read_recording(folder / "recording.csv", opened[0]))
    return explain(rows, lambda text: None)


def test_nothing_is_named_in_a_clean_recording(tmp_path: Path) -> None:
    found = asked((), tmp_path)
    assert found.nothing > 0.9


def test_what_was_left_out_is_named(tmp_path: Path) -> None:
    """Probabilities of sets add up to those of names."""
    found = asked(("slip-warm",), tmp_path)
    named = max(p for name, p in found.names.items() if ".slip-temperature@" in name)
    assert named > 0.9
    assert abs(sum(found.sets.values()) - 1.0) < 1e-9


def test_the_most_probable_set_is_told() -> None:
    """The shipped example: slip by temperature, and the temperature at which the law holds."""
    plant = ROOT / "plants" / "abc"
    opened = open_builder(plant)
    recording = read_recording(plant / "examples" / "warm_A.csv", opened[0])
    found = search(rows_at(opened, recording), lambda text: None)
    (accepted,) = found.accepted
    assert accepted.candidate.id == "A.slip-temperature@Q_geo"
    assert accepted.probability > 0.9
    values = found.fitted.setting.values
    slope = values["A.slip-temperature@Q_geo.b"]
    assert abs(slope - 0.03) < 3.0 * found.fitted.u("A.slip-temperature@Q_geo.b")
