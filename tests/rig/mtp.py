"""Real Module Type Packages: what an import finds of what a plain walk over the XML counts.

The walk shares nothing with the importer. It counts children of lists of instances (tags), their
attributes named ...Unit that hold anything (units), and attributes that hold the id of an item of a
list of sources (nodes). A unit counts as found if its code is known, and as online if only the
controller holds it.

Times are CPU seconds of the whole command without its start, for twenty files.
"""

import contextlib
import io
import itertools
import json
import os
import tempfile
import time
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rulec.cli import main
from tests.conftest import ROOT
from tests.figures.share import Share

MANY = 20
"""Files whose time is taken together."""


def folder() -> Path:
    """Folder of the real files, which are not part of the project."""
    return Path(os.environ.get("RULEC_MTP", ROOT.parent / "shared" / "mtp"))


def files() -> list[Path]:
    return sorted(f for f in folder().glob("*") if f.suffix in (".mtp", ".zip", ".aml"))


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


def present(file: Path) -> dict[str, Any]:
    """Tags, units and nodes of a file, and the identifier of each node by tag and attribute."""
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
    for root in roots:
        for one in root.iter():
            if not (one.get("RefBaseSystemUnitPath") or "").endswith("/InstanceList"):
                continue
            for tag in (e for e in one if local(e) == "InternalElement"):
                tags += 1
                for a in (e for e in tag if local(e) == "Attribute"):
                    value, name = text_of(a, "Value"), a.get("Name", "")
                    units += name.endswith("Unit") and bool(value or text_of(a, "DefaultValue"))
                    if value in items:
                        nodes.append((tag.get("Name", ""), name, items[value]))
    return {"tags": tags, "units": units, "nodes": nodes}


def imported(asked: list[Path]) -> tuple[dict[str, Any], float]:
    """Machine form of an import, and the CPU seconds that it took."""
    with tempfile.TemporaryDirectory() as at:
        out, form = Path(at) / "out", Path(at) / "found.json"
        before = time.process_time()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            main(["import", "mtp", *map(str, asked), "-o", str(out), "--json", str(form)])
        taken = time.process_time() - before
        found: dict[str, Any] = json.loads(form.read_text(encoding="utf-8"))
    return found, taken


def found_of(module: dict[str, Any]) -> set[tuple[str, str, str]]:
    """Tag, attribute and node of all that was found."""
    return {
        (tag["name"], name, attribute["node"])
        for tag in module["tags"]
        for name, attribute in tag["attributes"].items()
        if "node" in attribute
    }


def compared(file: Path) -> dict[str, Any]:
    found, _ = imported([file])
    whole = present(file)
    row: dict[str, Any] = {"refused": bool(found["refused"])}
    counts = [module["counts"] for module in found["modules"]]
    nodes = set().union(*(found_of(module) for module in found["modules"]), set())
    right = sum(
        any((tag, name) == (t, n) and node.endswith(identifier) for t, n, node in nodes)
        for tag, name, identifier in whole["nodes"]
    )
    for name in ("tags", "units"):
        row[name] = Share(sum(c[name] for c in counts), whole[name])
    return row | {
        "online": sum(c["online"] for c in counts),
        "nodes": Share(right, len(whole["nodes"])),
    }


def seconds(good: list[Path]) -> float:
    """CPU seconds for so many of the files that can be read, the best of three."""
    return min(imported(many(good))[1] for _ in range(3))


def plain_seconds(good: list[Path]) -> float:
    """CPU seconds of the plain walk over the same files, the best of three."""

    def once() -> float:
        before = time.process_time()
        for file in many(good):
            present(file)
        return time.process_time() - before

    return min(once() for _ in range(3))


def many(good: list[Path]) -> list[Path]:
    return list(itertools.islice(itertools.cycle(good), MANY))
