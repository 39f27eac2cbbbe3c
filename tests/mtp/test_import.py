"""What an import finds, writes and tells."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from rulec_runtime.live.sources.map import OPCUA, read_map

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT
from tests.mtp.writer import (
    ENDPOINT,
    EXAMPLE,
    FLOW,
    LEVEL,
    LIBRARY,
    NAMESPACE,
    PRESSURE,
    Point,
    attribute,
    element,
    example,
    manifest,
)


def imported(folder: Path, text: str, *more: str, code: int = 0) -> dict[str, Any]:
    """The machine form of the only module of a manifest; its files stand in folder/out."""
    file = folder / "m.aml"
    file.write_text(text, encoding="utf-8")
    asked = ["import", "mtp", str(file), "-o", str(folder / "out"), *more]
    assert code == main([*asked, "--json", str(folder / "found.json")])
    found: dict[str, Any] = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    return found["modules"][0]


def test_the_shipped_example_is_what_the_writer_writes() -> None:
    assert example() == EXAMPLE.read_text(encoding="utf-8")


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
    assert pressure["node"] == f"nsu={NAMESPACE};s=PI11.V"
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


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        (f"{LIBRARY}/AnaView/AnaMon", "AnaMon"),
        (f"Std@[{LIBRARY}]/IndicatorElement/[AnaView]", "AnaView"),
        (f"{LIBRARY}/AnaView/OurOwnView", "AnaView"),
        ("MakerLib/Transmitter", "AnaMon"),
        ("MakerLib/Unknown", "MakerLib/Unknown"),
    ],
)
def test_classes_are_known_by_any_path(tmp_path: Path, path: str, kind: str) -> None:
    """Of older libraries, with aliases, and of a maker's own that derives from the standard."""
    library = (
        '<SystemUnitClassLib Name="MakerLib"><SystemUnitClass Name="Transmitter" '
        f'RefBaseClassPath="{LIBRARY}/IndicatorElement/AnaView/AnaMon"/></SystemUnitClassLib>'
    )
    point = Point(name="PI1", path=path, fixed={"VUnit": "1137"})
    module = imported(tmp_path, manifest((point,), libraries=library))
    assert module["tags"][0]["class"] == kind
    assert bool(module["signals"]) == (kind != path)


def test_references_that_lead_nowhere_are_told_with_their_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = manifest((PRESSURE, FLOW)).replace('ID="item-1-V"', 'ID="other"')
    module = imported(tmp_path, text)
    assert (module["counts"]["nodes"], module["counts"]["nodes_present"]) == (1, 2)
    line = next(i for i, row in enumerate(text.splitlines(), 1) if ">item-1-V<" in row)
    told = f"m.aml:{line}: FI12.V refers to 'item-1-V', which is not there; export again"
    assert told in capsys.readouterr().out
    assert "Dosing.FI12" not in (tmp_path / "out" / "map.yaml").read_text(encoding="utf-8")


def test_parts_that_are_missing_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Files that the manifest leaves services to, and a list of sources without nodes."""
    set_of = element("Services", "set", "MTPSUCLib/ServiceSet", attribute("refURI", "//S/Own.aml"))
    text = manifest((Point(name="FI1", bound=()),))
    text = text.replace(
        "</InternalElement>\n</InstanceHierarchy>",
        f"{set_of}\n</InternalElement>\n</InstanceHierarchy>",
        1,
    )
    module = imported(tmp_path, text)
    assert [o["kind"] for o in module["odd"]] == ["parts that are missing", "no nodes"]
    assert (
        "it refers to '//S/Own.aml', which is not there; give the whole" in capsys.readouterr().out
    )


def test_tags_may_stand_in_groups(tmp_path: Path) -> None:
    """Of a list that has a name and no class."""
    text = manifest((PRESSURE, FLOW))
    path = ' RefBaseSystemUnitPath="MTPSUCLib/CommunicationSet/InstanceList">'
    head = f'<InternalElement Name="InstanceList" ID="instances"{path}'
    group = '<InternalElement Name="InstanceList" ID="instances"><InternalElement Name="G" ID="g">'
    end = '</InternalElement>\n</InternalElement>\n<InternalElement Name="SourceList"'
    closed = end.replace("\n", "\n</InternalElement>\n", 1)
    module = imported(tmp_path, text.replace(head, group).replace(end, closed))
    assert [tag["name"] for tag in module["tags"]] == ["PI11", "FI12"]
    assert module["counts"]["nodes"] == 2


def test_an_identifier_may_be_a_number_or_a_whole_node_id(tmp_path: Path) -> None:
    text = manifest((PRESSURE, FLOW, LEVEL), namespace="4")
    text = text.replace("<Value>PI11.V<", "<Value>ns=3;s=own.PI11<").replace(
        'Name="Identifier" AttributeDataType="xs:string"><Value>FI12.V<',
        'Name="Identifier" AttributeDataType="xs:unsignedInt"><Value>1017<',
    )
    nodes = [s["node"] for s in imported(tmp_path, text)["signals"]]
    assert nodes == ["ns=3;s=own.PI11", "ns=4;i=1017", "ns=4;s=LI13.V"]


GUID = "72962b91-fa75-4ae6-8d28-b404dc7daf63"


@pytest.mark.parametrize(
    ("kind", "value", "node", "why"),
    [
        ("xs:ID", GUID, f"ns=4;g={GUID}", ""),
        ("xs:base64Binary", "M/RbKBsRVkePCePcx24oRA==", "ns=4;b=M/RbKBsRVkePCePcx24oRA==", ""),
        ("xs:integer", "1005", "ns=4;i=1005", ""),
        ("xs:string", f"ns=3;g={GUID}", f"ns=3;g={GUID}", ""),
        ("xs:ID", "pump.dp", "", "'pump.dp' of type xs:ID, which is not a GUID"),
        ("xs:base64Binary", "M/R", "", "'M/R' of type xs:base64Binary, which is not base64"),
        ("xs:int", "pump", "", "'pump' of type xs:int, which is not a whole number of 32 bits"),
        ("xs:string", "ns=3;i=pump", "", "'ns=3;i=pump', which is not a whole number of 32 bits"),
    ],
)
def test_identifiers_are_of_their_types(
    tmp_path: Path, kind: str, value: str, node: str, why: str
) -> None:
    """What is none of its type is told with its place, and leaves the signal without a node."""
    written = 'AttributeDataType="xs:string"><Value>PI11.V<'
    text = manifest((PRESSURE,), namespace="4").replace(
        written, f'AttributeDataType="{kind}"><Value>{value}<'
    )
    module = imported(tmp_path, text)
    assert [s["node"] or "" for s in module["signals"]] == [node]
    told = [o["text"] for o in module["odd"] if o["kind"] == "items without node"]
    assert told == ([f"the item 'PI11.V' has the identifier {why}"] if why else [])


def test_nothing_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "own.yaml").write_text("own")
    assert 1 == main(["import", "mtp", str(EXAMPLE), "-o", str(tmp_path / "out")])
    assert "is not empty; name a new folder" in capsys.readouterr().err
    assert ["own.yaml"] == [f.name for f in (tmp_path / "out").iterdir()]


def test_good_files_are_imported_beside_bad_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = tmp_path / "bad.mtp"
    bad.write_bytes(b"")
    asked = ["import", "mtp", str(EXAMPLE), str(bad), str(tmp_path / "none.mtp")]
    assert 1 == main([*asked, "-o", str(tmp_path / "out")])
    shown = capsys.readouterr()
    assert shown.out.splitlines()[0].split()[:3] == ["file", "tags", "units"]
    assert shown.out.count("refused") == 2
    assert "bad.mtp: the file is empty; export it again" in shown.err
    assert "none.mtp: cannot be read (No such file" in shown.err
    assert (tmp_path / "out" / "modules" / "Dosing.yaml").is_file()
