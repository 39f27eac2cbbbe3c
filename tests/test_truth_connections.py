"""Plants that are connected otherwise than their file says."""

from __future__ import annotations

from pathlib import Path

import pytest

from rulec.prove.truth.settled.connections import WAYS
from rulec.prove.truth.settled.effect import CONNECTIONS
from rulec.prove.truth.settled.plan import Planned
from rulec.prove.truth.settled.suite import planned


def test_every_mistake_is_drawn() -> None:
    assert set(CONNECTIONS) == set(WAYS)
    assert {case.effects[0] for case in planned(3, {"connection": 24})} == set(WAYS)


@pytest.mark.parametrize("way", WAYS)
def test_the_file_and_the_plant_differ_by_one_pipe(way: str, tmp_path: Path) -> None:
    """What is wrong is the file: nothing is planted in the plant."""
    case = Planned(f"mistake {way}", "connection", "dosing", "steps", (way,), 2000.0).make()
    (planted,) = case.answer.effects
    assert case.stated is not None
    true, stated = case.scene.rig.downstream, case.stated.downstream
    (module,) = (name for name in true if true[name] != stated[name])
    assert planted.places == (f"{module}.outlet",)
    assert planted.gain > 2000.0
    assert "named" == case.answer.verdict
    assert () == case.terms
    case.write(tmp_path)
    lines = (tmp_path / "plant" / "plant.yaml").read_text(encoding="utf-8").splitlines()
    written = {tuple(line[4:].split(" -> ")) for line in lines if " -> " in line}
    assert written == {(a, b) for a, b in stated.items() if b is not None}
