"""The ZeMA rig without its thermometers: nobody recorded what moves its pump."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import recordings_folder
from tests.rig.mismatch import zema
from tests.rig.mismatch.ask import ask


@pytest.mark.prove
def test_the_oil_temperature_is_told_at_both_laws_that_it_moves(tmp_path: Path) -> None:
    """Friction and slip follow it: no drift of a sensor, no fault, and its course."""
    folder = recordings_folder()
    if not (folder / zema.FOLDER).is_dir():
        pytest.skip(f"no real recordings at {folder} (set RULEC_RECORDINGS)")
    name = "zema on profile without temperatures"
    (case,) = (c for c in zema.prepare(folder, tmp_path) if c.name == name)
    answer = ask(case, tmp_path)
    assert answer.verdict == "unnamed"
    assert {e["sort"] for e in answer.form["effects"]} <= {"free"}
    assert {p["place"] for p in answer.form["locations"]} == {"P_law", "Q_law"}
    assert abs(zema.driver_likeness(answer, folder)) > 0.95
    flow = next(fit for fit in answer.form["fits"] if fit["signal"] == "main.Q")
    # The course of a temperature that nobody recorded is no part of a model.
    assert flow["heldout"]["explained"] < flow["heldout"]["noise"]
