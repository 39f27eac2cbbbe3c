"""Import modules from files: what was found, what is odd, and the files to write."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rulec_runtime.live.sources.map import Access
from rulec_runtime.live.sources.map import Server as Source
from rulec_runtime.live.sources.remarks import extra
from rulec_runtime.output.terminal import is_shown

from rulec.knowledge.knowledge import Knowledge
from rulec.mtp import limits
from rulec.mtp.package import Attribute, MtpRefused, Oddity, Package
from rulec.mtp.read_package import read_packages
from rulec.mtp.readings import Reading, module_name, readings_of, unit_of
from rulec.mtp.skeleton import instance_name, skeleton, source_map


@dataclass(frozen=True, kw_only=True)
class Imported:
    """A module; `name` is the name of its type. `counts` say how much was found, and with
    ``_present`` how much there is; ``online`` are units that only the controller holds."""

    name: str
    package: Package
    readings: Sequence[Reading]
    odd: Sequence[Oddity]
    counts: Mapping[str, int]


def import_files(
    paths: Iterable[Path], knowledge: Knowledge, online: str | None
) -> tuple[list[Imported], list[tuple[Path, str]]]:
    """Modules of all files under unique names, and the refused files with reasons.

    `online` is where to read units and ranges that the files leave to controllers: at an endpoint,
    at those that the files name (empty), or nowhere (None).
    """
    found: list[Imported] = []
    refused: list[tuple[Path, str]] = []
    for path in paths:
        try:
            packages = read_packages(path)
        except MtpRefused as error:
            refused.append((path, str(error)))
        except OSError as error:
            refused.append((path, f"{path}: cannot be read ({error.strerror})"))
        else:
            for package in packages:
                taken = {instance_name(one.name).lower() for one in found}
                whole = package if online is None else read_online(package, online)
                found.append(_imported(whole, knowledge, taken))
    return found, refused


def _imported(package: Package, knowledge: Knowledge, taken: set[str]) -> Imported:
    readings, odd = readings_of(package, knowledge.units, knowledge.sensors)
    name = base = module_name(package.name)
    count = 1
    while instance_name(name).lower() in taken:
        count += 1
        name = f"{base}-{count}"
    return Imported(
        name=name,
        package=package,
        readings=readings,
        odd=(*package.odd, *odd),
        counts=_counts(package, readings, knowledge),
    )


def _counts(package: Package, readings: Sequence[Reading], knowledge: Knowledge) -> dict[str, int]:
    """A tag counts as found if its class is known, a unit if its code is, a node if its id is."""
    attributes = [(n, a) for tag in package.tags for n, a in tag.attributes.items()]
    units = [a for n, a in attributes if n.endswith("Unit") and (a.value or a.refers)]
    unknown = [a for a in units if not unit_of(a, knowledge.units).text]
    return {
        "tags": sum(bool(tag.kind) for tag in package.tags),
        "tags_present": len(package.tags),
        "units": len(units) - len(unknown),
        "units_present": len(units),
        "online": sum(a.node is not None for a in unknown),
        "nodes": sum(a.node is not None for _, a in attributes),
        "nodes_present": sum(a.refers for _, a in attributes),
        "services": len(package.services),
        "signals": sum(not r.lacks and not r.repeats for r in readings),
    }


def files_of(modules: Sequence[Imported]) -> Mapping[str, str]:
    """Text of each file to write, by its path below the folder."""
    files = {f"modules/{m.name}.yaml": skeleton(m.package, m.name, m.readings) for m in modules}
    files["map.yaml"] = source_map({m.name: (m.package, m.readings) for m in modules})
    return files


def json_form(modules: Sequence[Imported], refused: Sequence[tuple[Path, str]]) -> Any:
    """All results in JSON form."""
    return {
        "modules": [_module(m) for m in modules],
        "refused": [{"file": str(path), "why": why} for path, why in refused],
    }


def _module(one: Imported) -> dict[str, Any]:
    package = one.package
    return {
        "module": one.name,
        "file": package.file,
        "name": package.name,
        "version": package.version,
        "writer": package.writer,
        "counts": dict(one.counts),
        "servers": [vars(server) for server in package.servers],
        "tags": [
            {
                "name": tag.name,
                "tag_name": tag.given,
                "title": tag.title,
                "class": tag.kind or tag.path,
                "place": tag.place,
                "attributes": {n: _attribute(a) for n, a in tag.attributes.items()},
            }
            for tag in package.tags
        ],
        "signals": [_signal(reading) for reading in one.readings],
        "services": package.services,
        "connections": package.connections,
        "odd": [vars(oddity) for oddity in one.odd],
    }


def _attribute(attribute: Attribute) -> dict[str, str]:
    node = attribute.node
    found = {"value": attribute.text, "default": attribute.default}
    if node is not None:
        found |= {"node": node.id, "access": node.access, "server": node.server}
    return {key: text for key, text in found.items() if text}


def _signal(reading: Reading) -> dict[str, Any]:
    return {
        "signal": reading.signal,
        "tag": reading.tag.name,
        "attribute": reading.attribute,
        "node": reading.node.id if reading.node else None,
        "unit": reading.unit.text or None,
        "unit_as_written": reading.unit.raw or None,
        "range": list(reading.range) if reading.range else None,
        "quantity": reading.proposal.quantity or None,
        "confidence": reading.proposal.confidence,
        "because": reading.proposal.because,
        "sensor": reading.sensor or None,
        "input": reading.is_input,
        "repeats": reading.repeats,
        "lacks": reading.lacks or None,
    }


_ASKED = ("Unit", "SclMin", "SclMax")


def read_online(package: Package, endpoint: str) -> Package:
    """The package with the current values of its servers; failures become oddities.

    `endpoint`, if not empty, replaces the one in the file. Raises `SourceRefused` if the OPC UA
    package is not installed.
    """
    extra("asyncua", "opcua")
    asked: dict[str, dict[str, None]] = {}
    for name, a in (item for tag in package.tags for item in tag.attributes.items()):
        if name.endswith(_ASKED) and a.node is not None:
            asked.setdefault(a.node.server, {})[a.node.id] = None
    values: dict[str, str] = {}
    odd: list[Oddity] = []
    for server in package.servers:
        address, nodes = endpoint or server.endpoint, [*asked.get(server.name, ())]
        if nodes and address:
            values |= _read(package, address, nodes, odd)
    tags = tuple(
        replace(
            tag,
            attributes={
                name: replace(a, text=values[a.node.id])
                if name.endswith(_ASKED) and a.node is not None and a.node.id in values
                else a
                for name, a in tag.attributes.items()
            },
        )
        for tag in package.tags
    )
    return replace(package, tags=tags, odd=(*package.odd, *odd))


def _read(
    package: Package, address: str, asked: Sequence[str], odd: list[Oddity]
) -> Mapping[str, str]:
    from rulec_runtime.live.sources.opcua_nodes import read_once

    try:
        found = read_once(Source(name="", endpoint=address, access=Access()), asked, limits.ONLINE)
    except ConnectionError as error:
        remedy = "where it has another address, import the file alone with --online ADDRESS"
        text = f"{address}: {error}"
        odd.append(Oddity("servers that do not answer", package.file, text, remedy))
        return {}
    values = {}
    for node, value in zip(asked, found, strict=True):
        if 0 < len(value) <= limits.LONGEST_NAME and all(map(is_shown, value)):
            values[node] = value
        else:
            text = f"{address}: {node} has no value"
            remedy = "look it up in the server, and write what it says into the skeleton"
            odd.append(Oddity("values not there", package.file, text, remedy))
    return values
