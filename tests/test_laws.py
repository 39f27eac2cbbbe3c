"""What a module type says of its laws and parameters: how exact, and which values can be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rulec.commands.check_files import collect
from rulec.effects.model_builder import open_builder
from rulec.effects.write_module import write_module
from tests.conftest import ROOT

PLANTS = ROOT / "plants"


def test_a_law_keeps_its_accuracy_where_its_error_looks_like_anothers() -> None:
    """An error of the head shifts the loss as far; as a place where something acts, one counts."""
    _, builder = open_builder(PLANTS / "rse-boiler")
    stated = {law.place: law.accuracy for law in builder.laws}
    assert {"head": 0.05, "opening": 0.1, "resistance": 0.08} == stated
    assert "head" not in {spot.place for spot in builder.spots}


def test_a_meter_is_no_law(tmp_path: Path) -> None:
    """Not even one whose scale is uncertain; what the pump does is one."""
    text = (ROOT / "tests" / "loop" / "warm-loop.yaml").read_text(encoding="utf-8")
    text = text.replace("sensor: current-loop", "sensor: analog-output")
    (tmp_path / "kind.yaml").write_text(text, encoding="utf-8")
    told = {d.message.split("'")[1] for d in collect([tmp_path]) if d.code == "KB143"}
    assert {"pump", "line"} == told


def test_what_the_sheet_says_outlives_a_calibration() -> None:
    """Value and u of each parameter, beside the calibrated value, and what its sign allows."""
    _, builder = open_builder(PLANTS / "zema-hydraulic")
    known = builder.parameters
    place = known.ids.index("main.Q0")
    assert set(known.ids) == set(known.sheet)
    assert known.sheet["main.Q0"] == pytest.approx((9 / 60e3, 1 / 60e3))
    assert known.values[place] == pytest.approx(8.742 / 60e3, rel=1e-3)
    assert known.positive[place]
    assert known.lowest[place] == 0.0
    assert not known.positive[known.ids.index("main.P3")]


@pytest.mark.parametrize(("share", "told"), [(0.5, []), (-0.5, ["KB125"])])
def test_an_amended_type_says_what_its_new_parts_may_be(
    share: float, told: list[str], tmp_path: Path
) -> None:
    """A share lies in its range; what a reading should be is no law that may be off by 5 %."""
    _, builder = open_builder(PLANTS / "rse-boiler")
    assert builder.sources is not None
    documents = builder.sources.by_kind["module"]
    (document,) = (d for d in documents if d.data["module"] == "pumped-valve-branch")
    (effect,) = (c for c in builder.candidates if c.name == "equal-percentage")
    kind = replace(builder.amended("boiler", (effect.id,)).type, name="own")
    values = {"s": share, "R": 30.0}
    brought = {n: replace(kind.parameters[n], value=v, u=0.1) for n, v in values.items()}
    text = write_module(document, kind, brought, [])
    (tmp_path / "kind.yaml").write_text(text, encoding="utf-8")
    assert told == [d.code for d in collect([tmp_path])]
    assert "range: [3, 300]" in text
    assert 'accuracy: "0 %, the class of the sensor says it"' in text
