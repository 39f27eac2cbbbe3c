"""What an import finds, concludes, writes and tells."""

import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from rulec_runtime.live.sources.map import OPCUA, read_map

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, Capsys
from tests.mtp import writer
from tests.mtp.writer import ENDPOINT, EXAMPLE, FLOW, LIBRARY, PRESSURE, analog, example, manifest
from tests.written import json_of


def imported(folder: Path, text: str, *more: str, code: int = 0) -> dict[str, Any]:
    """The machine form of the only module of a manifest; its files stand in folder/out."""
    file = folder / "m.aml"
    file.write_text(text, encoding="utf-8")
    found = json_of("import", "mtp", file, "-o", folder / "out", *more, code=code)
    return dict(found["modules"][0])


def test_both_versions_of_caex_give_the_same(tmp_path: Path) -> None:
    """One without and one with an XML namespace."""
    found = []
    for version in ("2.15", "3.0"):
        folder = tmp_path / version
        folder.mkdir()
        imported(folder, example(version))
        texts = sorted((folder / "out").rglob("*.yaml"))
        found.append([text.read_text(encoding="utf-8") for text in texts])
    assert found[0] == found[1]


def test_all_of_the_example_is_found(tmp_path: Path) -> None:
    module = imported(tmp_path, example())
    assert module["counts"] == {
        "tags": 6, "tags_present": 6, "units": 5, "units_present": 6, "online": 1,
        "nodes": 8, "nodes_present": 8, "services": 1, "signals": 4,
    }  # fmt: skip
    assert module["servers"] == [{"name": "OPCServer", "endpoint": ENDPOINT}]
    pressure = next(s for s in module["signals"] if s["signal"] == "PI11")
    assert (pressure["unit"], pressure["range"]) == ("bar", [0.0, 10.0])
    assert (pressure["quantity"], pressure["confidence"]) == ("pressure difference", "likely")
    assert pressure["node"] == f"nsu={writer.NAMESPACE};s=PI11.V"
    (service,) = module["services"]
    assert [p["name"] for p in service["procedures"]] == ["continuous"]
    assert service["parameters"] == [
        {"name": "Flow", "kind": "ProcedureParameter", "tag": "Dose.Flow"}
    ]
    assert [c["ends"] for c in module["connections"]] == [["Tank", "PU01"], ["PU01", "Outlet"]]
    assert module["odd"] == []


def test_what_is_written_becomes_a_watched_plant(tmp_path: Path) -> None:
    """The skeleton passes the check; with an observer it compiles, and the map fits the plant."""
    imported(tmp_path, example())
    out = tmp_path / "out"
    assert collect([out]) == []
    shutil.copytree(ROOT / "kb", tmp_path / "kb")
    text = (out / "modules" / "Dosing.yaml").read_text(encoding="utf-8")
    observer = 'observers:\n  meter: {component: line, Q: FI12, source: "own"}\n'
    (tmp_path / "kb" / "modules" / "Dosing.yaml").write_text(text + observer, encoding="utf-8")
    plant = "plant: p\ntitle: t\nkb: kb\nmodules: {Dosing: {type: Dosing}}\n"
    (tmp_path / "plant.yaml").write_text(plant, encoding="utf-8")
    source = read_map(out / "map.yaml", OPCUA, compile_plant(tmp_path))
    assert [c.signal.id for c in source.channels] == [
        "Dosing.PU01", "Dosing.PI11", "Dosing.FI12", "Dosing.LI13",
    ]  # fmt: skip
    assert {c.server for c in source.channels} == {"Dosing"}


def test_several_files_share_one_map(tmp_path: Path) -> None:
    """Modules of one name get numbers; each has its own server."""
    files = []
    for number in (1, 2):
        files.append(tmp_path / f"{number}.aml")
        text = manifest((FLOW,), name="A-1", endpoint=f"opc.tcp://10.0.0.{number}:4840")
        files[-1].write_text(text, encoding="utf-8")
    assert 0 == main(["import", "mtp", *map(str, files), "-o", str(tmp_path / "out")])
    data = yaml.safe_load((tmp_path / "out" / "map.yaml").read_text(encoding="utf-8"))
    assert {name: s["endpoint"] for name, s in data["servers"].items()} == {
        "A_1": "opc.tcp://10.0.0.1:4840",
        "A_1_2": "opc.tcp://10.0.0.2:4840",
    }
    assert set(data["signals"]) == {"A_1.FI12", "A_1_2.FI12"}


def test_classes_are_known_by_any_path(tmp_path: Path) -> None:
    """Of older libraries, with aliases, and of a maker's own that derives from the standard."""
    library = (
        '<SystemUnitClassLib Name="MakerLib"><SystemUnitClass Name="Transmitter" '
        f'RefBaseClassPath="{LIBRARY}/IndicatorElement/AnaView/AnaMon"/></SystemUnitClassLib>'
    )
    kinds = {
        f"{LIBRARY}/AnaView/AnaMon": "AnaMon",
        f"Std@[{LIBRARY}]/IndicatorElement/[AnaView]": "AnaView",
        "MakerLib/Transmitter": "AnaMon",
        "MakerLib/Unknown": "MakerLib/Unknown",
    }
    points = [
        writer.Point(name=f"PI{i}", path=p, fixed={"VUnit": "1137"}) for i, p in enumerate(kinds)
    ]
    module = imported(tmp_path, manifest(points, libraries=library))
    assert [tag["class"] for tag in module["tags"]] == list(kinds.values())
    assert [s["signal"] for s in module["signals"]] == ["PI0", "PI1", "PI2"]


def test_references_that_lead_nowhere_are_told_with_their_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = manifest((PRESSURE, FLOW)).replace('ID="item-1-V"', 'ID="other"')
    module = imported(tmp_path, text)
    assert (module["counts"]["nodes"], module["counts"]["nodes_present"]) == (1, 2)
    line = next(i for i, row in enumerate(text.splitlines(), 1) if ">item-1-V<" in row)
    report = f"m.aml:{line}: FI12.V refers to 'item-1-V', which is not there; export again"
    assert report in capsys.readouterr().out
    assert "Dosing.FI12" not in (tmp_path / "out" / "map.yaml").read_text(encoding="utf-8")


GUID = "72962b91-fa75-4ae6-8d28-b404dc7daf63"


def test_identifiers_are_of_their_types(tmp_path: Path) -> None:
    """What is none of its type is told with its place, and leaves the signal without a node."""
    binary = "M/RbKBsRVkePCePcx24oRA=="
    for kind, value, node, why in (
        ("xs:ID", GUID, f"ns=4;g={GUID}", ""),
        ("xs:base64Binary", binary, f"ns=4;b={binary}", ""),
        ("xs:string", f"ns=3;g={GUID}", f"ns=3;g={GUID}", ""),
        ("xs:ID", "pump.dp", None, "type xs:ID, which is not a GUID"),
        ("xs:base64Binary", "M/R", None, "type xs:base64Binary, which is not base64"),
        ("xs:int", "pump", None, "type xs:int, which is not a whole number of 32 bits"),
    ):
        text = manifest((PRESSURE,), namespace="4").replace(
            'AttributeDataType="xs:string"><Value>PI11.V<',
            f'AttributeDataType="{kind}"><Value>{value}<',
        )
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
        module = imported(tmp_path, text)
        assert [s["node"] for s in module["signals"]] == [node]
        odd = [o["text"] for o in module["odd"] if o["kind"] == "items without node"]
        said = f"the item 'PI11.V' has the identifier '{value}' of {why}"
        assert odd == ([said] if why else [])


def test_good_files_are_imported_beside_bad_ones(tmp_path: Path, capsys: Capsys) -> None:
    """And nothing is written over."""
    bad, out = tmp_path / "bad.mtp", tmp_path / "out"
    bad.write_bytes(b"")
    asked = ["import", "mtp", str(EXAMPLE), str(bad), str(tmp_path / "none.mtp"), "-o", str(out)]
    assert 1 == main(asked)
    shown = capsys.readouterr()
    assert shown.out.splitlines()[0].split()[:3] == ["file", "tags", "units"]
    assert shown.out.count("refused") == 2
    assert "bad.mtp: the file is empty; export it again" in shown.err
    assert "none.mtp: cannot be read (No such file" in shown.err
    before = {f: f.read_bytes() for f in out.rglob("*") if f.is_file()}
    assert out / "modules" / "Dosing.yaml" in before
    assert 1 == main(["import", "mtp", str(EXAMPLE), "-o", str(out)])
    assert "is not empty; name a new folder" in capsys.readouterr().err
    assert before == {f: f.read_bytes() for f in out.rglob("*") if f.is_file()}


UNITS = {
    "1352": ("l/min", None),
    "m³/h": ("m3/h", None),
    "1038": ("l", "a sensor class for this quantity"),
    "1076": ("m/s**2", "a quantity for m/s**2: units.yaml has none"),
    "1363": ("gal/min", None),
    "1051": ("bbl", "the unit bbl: it is not in units.yaml; add it, or another"),
    "23": (None, "the unit: '23' is no unit code that is known"),
    "": (None, "the unit: the data sheet says it"),
}
"""Codes or texts, with the unit that they mean, and what is lacking."""


def test_units_are_codes_or_texts(tmp_path: Path) -> None:
    """What is not known stands as a comment that says what is lacking."""
    points = [analog(f"FI{i}", "", code, 0, 5) for i, code in enumerate(UNITS)]
    module = imported(tmp_path, manifest(points))
    assert [(s["unit"], s["lacks"]) for s in module["signals"]] == list(UNITS.values())
    text = (tmp_path / "out" / "modules" / "Dosing.yaml").read_text(encoding="utf-8")
    assert all(f"# TODO lacks {lacks}" in text for _, lacks in UNITS.values() if lacks)
    lines = [o["place"].rpartition(":")[0] for o in module["odd"] if o["kind"] == "unknown units"]
    assert lines == ["m.aml"]


def test_quantities_are_proposed_with_a_confidence(tmp_path: Path) -> None:
    """By name, unit and title; where name and unit contradict each other, that is told."""
    points = [
        analog("FI1", "", "1353", 0, 5),
        analog("X1", "", "1353", 0, 5),
        analog("X2", "Druck am Ausgang", "1353", 0, 5),
        analog("X3", "Druck am Ausgang", "", 0, 5),
        analog("X4", "", "", 0, 5),
    ]
    module = imported(tmp_path, manifest(points))
    assert [(s["quantity"], s["confidence"]) for s in module["signals"]] == [
        ("volume flow", "likely"),
        ("volume flow", "possible"),
        ("volume flow", "guess"),
        ("pressure difference", "guess"),
        (None, "guess"),
    ]
    assert [o["kind"] for o in module["odd"]] == ["names against units"]


def test_ranges_and_names_are_those_that_equations_can_use(tmp_path: Path) -> None:
    """A range has its lower end first. Names become such that equations can use: also words of
    the language, doubles, umlauts and nothing but signs."""
    spans = {"A1": (0, 5), "A2": (5, 0), "A3": (5, 5), "A4": (0, 1e99)}
    points = [analog(name, "", "1137", *span) for name, span in spans.items()]
    module = imported(tmp_path, manifest(points))
    assert [s["range"] for s in module["signals"]] == [[0.0, 5.0], None, None, None]
    assert [bool(s["lacks"]) for s in module["signals"]] == [False, True, True, True]
    assert [o["kind"] for o in module["odd"]] == ["ranges that are none"] * 3
    shutil.rmtree(tmp_path / "out")
    names = ("A.if", "B.if", "Füllstand-1", "§§", "9", "x" * 90, "inflow", "min")
    points = [analog(name, "", "1013", 0, 800) for name in names]
    module = imported(tmp_path, manifest(points, name="(1)"))
    signals = [s["signal"] for s in module["signals"]]
    assert len(set(signals)) == len(names)
    assert signals[:5] == ["A_if", "B_if", "Fuellstand_1", "x", "x9"]
    assert collect([tmp_path / "out"]) == []
