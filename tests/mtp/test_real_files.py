"""Files of real makers, which are not part of the project: an import finds what a plain walk over
the XML counts, which shares nothing with the importer.

The walk counts children of lists of instances (tags), their attributes named ...Unit that hold
anything (units), and attributes that hold the id of an item of a list of sources (nodes). A unit
counts as found if its code is known, and as online if only the controller holds it.
"""

import json
import os
import time
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rulec.cli import main
from rulec.commands.check_files import collect
from tests.conftest import ROOT

FOLDER = Path(os.environ.get("RULEC_MTP", ROOT.parent / "shared" / "mtp"))
FILES = sorted(f for f in FOLDER.glob("*") if f.suffix in (".mtp", ".zip", ".aml"))

pytestmark = pytest.mark.skipif(not FILES, reason=f"no real packages in {FOLDER}")


def documents(file: Path) -> Iterator[ET.Element]:
    """Roots of the AutomationML files of a container; empty members are left out."""
    if file.suffix == ".aml":
        yield ET.parse(file).getroot()
        return
    with zipfile.ZipFile(file) as archive:
        for name in archive.namelist():
            if name.endswith(".aml") and (data := archive.read(name)):
                yield ET.fromstring(data)


def local(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]


def text_of(element: ET.Element, name: str) -> str:
    found = (child.text or "" for child in element if local(child) == name)
    return next(found, "").strip()


def present(file: Path) -> tuple[int, int, list[tuple[str, str, str]]]:
    """Tags and units of a file; tag, attribute and identifier of each node."""
    roots = list(documents(file))
    items = {
        e.get("ID", ""): text_of(a, "Value")
        for root in roots
        for e in root.iter()
        if local(e) == "ExternalInterface"
        for a in e
        if a.get("Name") == "Identifier"
    }
    tags, units, nodes = 0, 0, []
    for one in (one for root in roots for one in root.iter()):
        if not (one.get("RefBaseSystemUnitPath") or "").endswith("/InstanceList"):
            continue
        for tag in (e for e in one if local(e) == "InternalElement"):
            tags += 1
            for a in (e for e in tag if local(e) == "Attribute"):
                value, name = text_of(a, "Value"), a.get("Name", "")
                units += name.endswith("Unit") and bool(value or text_of(a, "DefaultValue"))
                if value in items:
                    nodes.append((tag.get("Name", ""), name, items[value]))
    return tags, units, nodes


def imported(folder: Path, *files: Path) -> dict[str, Any]:
    """Machine form of an import, which refuses the broken ones."""
    form = folder / "found.json"
    main(["import", "mtp", *map(str, files), "-o", str(folder / "out"), "--json", str(form)])
    return dict(json.loads(form.read_text(encoding="utf-8")))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.name)
def test_all_tags_units_and_nodes_are_found(file: Path, tmp_path: Path) -> None:
    """Units by the file, or else by the controller; tags and nodes all."""
    found = imported(tmp_path, file)
    if found["refused"]:
        assert file.name.startswith("broken")
        return
    assert [] == [one for one in collect([tmp_path / "out"]) if not one.doubt]
    tags, units, nodes = present(file)
    counts = [module["counts"] for module in found["modules"]]
    totals = {
        (tag["name"], name, attribute["node"])
        for module in found["modules"]
        for tag in module["tags"]
        for name, attribute in tag["attributes"].items()
        if "node" in attribute
    }
    for tag, name, identifier in nodes:
        assert any((tag, name) == (t, n) and node.endswith(identifier) for t, n, node in totals)
    assert units == sum(c["units"] + c["online"] for c in counts)
    assert tags - sum(c["tags"] for c in counts) <= 2  # terminations among the tags, in one file


def test_import_costs_a_few_readings_of_the_xml(tmp_path: Path) -> None:
    """CPU time as a ratio to the plain walk of the same files in the same run, the best of two.

    Alone the import takes some three times the walk; a limit in seconds fails
    on a machine that is busy.
    """
    good = [file for file in FILES if not file.name.startswith("broken")]

    def seconds(work: Callable[[Path], object]) -> float:
        times = []
        for number in range(2):
            (folder := tmp_path / f"{work.__name__}{number}").mkdir()
            begin = time.process_time()
            work(folder)
            times.append(time.process_time() - begin)
        return min(times)

    def ours(folder: Path) -> None:
        imported(folder, *good)

    def plain(_: Path) -> None:
        for file in good:
            present(file)

    assert seconds(ours) < 6.0 * seconds(plain)
