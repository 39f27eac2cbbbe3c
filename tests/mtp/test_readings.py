"""What is concluded of a tag: unit, range, quantity, name; and of a picture: pipes."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from rulec.commands.check_files import collect
from rulec.language.units import unit_table
from rulec.mtp.tables import tables
from tests.conftest import ROOT
from tests.mtp.test_import import imported
from tests.mtp.writer import DRIVE, analog, manifest, picture


@pytest.mark.parametrize(
    ("code", "unit", "lacks"),
    [
        ("1352", "l/min", ""),
        ("1352.0", "l/min", ""),
        ("m³/h", "m3/h", ""),
        ("1038", "l", "a sensor class for this quantity"),
        ("1076", "m/s**2", "a quantity for m/s**2: units.yaml has none"),
        ("1363", "gal/min", "the unit gal/min: it is not in units.yaml; add it, or another"),
        ("23", None, "the unit: '23' is no unit code that is known"),
        ("parrots", None, "the unit: 'parrots' is no unit code that is known"),
        ("", None, "the unit: the data sheet says it"),
    ],
)
def test_units_are_codes_or_texts(tmp_path: Path, code: str, unit: str | None, lacks: str) -> None:
    """What is not known stands as a comment that says what is lacking."""
    module = imported(tmp_path, manifest((analog("FI1", "", code, 0, 5),)))
    (signal,) = module["signals"]
    assert (signal["unit"], signal["lacks"] or "") == (unit, lacks)
    text = (tmp_path / "out" / "modules" / "Dosing.yaml").read_text(encoding="utf-8")
    assert (f"# TODO lacks {lacks}" in text) == bool(lacks)
    told = [o["place"].rpartition(":")[0] for o in module["odd"] if o["kind"] == "unknown units"]
    assert told == (["m.aml"] if code in ("23", "parrots") else [])


def test_units_of_the_tables_are_those_of_the_knowledge_base() -> None:
    """As many as have an entry there; quantities and sensor classes have one, all of them."""
    data = yaml.safe_load((ROOT / "kb" / "units.yaml").read_text(encoding="utf-8"))
    units = unit_table(data)
    for code in ("1137", "1342", "1349", "1352", "1353", "1085", "1001", "1013", "1186", "1097"):
        assert units.parse(tables().codes[code])
    named = {*tables().letters.values(), *tables().words, *tables().first, *tables().sensors}
    assert named <= set(units.quantities)
    classes = {name for names in tables().sensors.values() for name in names}
    assert classes <= {file.stem for file in (ROOT / "kb" / "sensors").glob("*.yaml")}


@pytest.mark.parametrize(
    ("name", "title", "unit", "quantity", "confidence"),
    [
        ("FI1", "", "1353", "volume flow", "likely"),
        ("X1", "", "1353", "volume flow", "possible"),
        ("X1", "Druck am Ausgang", "1353", "volume flow", "guess"),
        ("X1", "Druck am Ausgang", "", "pressure difference", "guess"),
        ("X1", "", "", None, "guess"),
    ],
)
def test_quantities_are_proposed_with_a_confidence(
    tmp_path: Path, name: str, title: str, unit: str, quantity: str | None, confidence: str
) -> None:
    module = imported(tmp_path, manifest((analog(name, title, unit, 0, 5),)))
    (signal,) = module["signals"]
    assert (signal["quantity"], signal["confidence"]) == (quantity, confidence)
    against = title and unit
    assert [o["kind"] for o in module["odd"]] == (["names against units"] if against else [])


@pytest.mark.parametrize(
    ("low", "high", "span"), [(0, 5, [0.0, 5.0]), (5, 0, None), (5, 5, None), (0, 1e99, None)]
)
def test_a_range_has_its_lower_end_first(
    tmp_path: Path, low: float, high: float, span: list[float] | None
) -> None:
    module = imported(tmp_path, manifest((analog("PI1", "", "1137", low, high),)))
    (signal,) = module["signals"]
    assert signal["range"] == span
    assert bool(signal["lacks"]) == (span is None)
    assert [o["kind"] for o in module["odd"]] == ([] if span else ["ranges that are none"])


def test_pipes_are_found_where_nothing_is_linked(tmp_path: Path) -> None:
    """By where they end in the picture; and then they are no more than possible."""
    drawn = picture({"Tank": "36030000", "PU01": "36410000"}, [()])
    for name, x in (("Tank", 100), ("PU01", 300)):
        box = {"X": x, "Y": 100, "Width": 50, "Height": 50}
        places = "".join(
            f'<Attribute Name="{n}"><Value>{value}</Value></Attribute>' for n, value in box.items()
        )
        drawn = drawn.replace(f'ID="port-{name}"', f'ID="port-{name}"', 1)
        head = (
            f'Name="{name}" ID="symbol-{name}" RefBaseSystemUnitPath="MTPHMISUCLib/VisualObject">'
        )
        drawn = drawn.replace(head, head + places)
    head = 'Name="Pipe_0" ID="pipe-0" RefBaseSystemUnitPath="MTPHMISUCLib/Connection/Pipe">'
    path = '<Attribute Name="Edgepath"><Value>155,120;220,120;295,130</Value></Attribute>'
    drawn = drawn.replace(head, head + path)
    module = imported(tmp_path, manifest((DRIVE,), pictures=(drawn,)))
    assert module["connections"] == [{"ends": ["Tank", "PU01"], "linked": False, "pipe": "Pipe_0"}]


def test_names_become_names_that_equations_can_use(tmp_path: Path) -> None:
    """Also words of the language, doubles, umlauts and nothing but signs."""
    names = ("A.if", "B.if", "Füllstand-1", "§§", "9", "x" * 90, "inflow", "min")
    points = [analog(name, "", "1013", 0, 800) for name in names]
    module = imported(tmp_path, manifest(points, name="(1)"))
    signals = [s["signal"] for s in module["signals"]]
    assert len(set(signals)) == len(names)
    assert signals[:5] == ["A_if", "B_if", "Fuellstand_1", "x", "x9"]
    assert collect([tmp_path / "out"]) == []
