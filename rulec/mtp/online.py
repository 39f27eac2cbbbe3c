"""Units and ranges that a package leaves to its controller, read from there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rulec_runtime.live.sources.map import Server as Source
from rulec_runtime.live.sources.map_access import Access
from rulec_runtime.live.sources.refused import extra
from rulec_runtime.output.terminal import is_shown

from rulec.mtp import limits
from rulec.mtp.package import Package, Tag
from rulec.mtp.refused import Oddity

_ASKED = ("Unit", "SclMin", "SclMax")


def read_online(package: Package, endpoint: str) -> Package:
    """The package with the values that its servers hold now; what fails is told as odd.

    `endpoint` replaces the one that the file names, if it is not empty. Raises `SourceRefused`
    where the package that speaks OPC UA is not installed.
    """
    extra("asyncua", "opcua")
    values: dict[str, str] = {}
    odd: list[Oddity] = []
    for server in package.servers:
        asked = _asked(package.tags, server.name)
        address = endpoint or server.endpoint
        if asked and address:
            values |= _read(package, address, asked, odd)
    tags = tuple(_with(tag, values) for tag in package.tags)
    return replace(package, tags=tags, odd=(*package.odd, *odd))


def _asked(tags: Sequence[Tag], server: str) -> list[str]:
    nodes = {
        a.node.id: None
        for tag in tags
        for name, a in tag.attributes.items()
        if name.endswith(_ASKED) and a.node is not None and a.node.server == server
    }
    return list(nodes)


def _read(
    package: Package, address: str, asked: Sequence[str], odd: list[Oddity]
) -> Mapping[str, str]:
    from rulec_runtime.live.sources.opcua_once import read_once

    source = Source(name="", endpoint=address, access=Access())
    try:
        found = read_once(source, asked, limits.ONLINE)
    except ConnectionError as error:
        odd.append(
            Oddity(
                kind="servers that do not answer",
                place=package.file,
                text=f"{address}: {error}",
                remedy="where it has another address, import the file alone with --online ADDRESS",
            )
        )
        return {}
    lacking = [node for node, text in zip(asked, found, strict=True) if not _usable(text)]
    for node in lacking:
        text = f"{address}: {node} has no value"
        remedy = "look it up in the server, and write what it says into the skeleton"
        odd.append(Oddity(kind="values not there", place=package.file, text=text, remedy=remedy))
    return {node: text for node, text in zip(asked, found, strict=True) if _usable(text)}


def _usable(text: str) -> bool:
    return 0 < len(text) <= limits.LONGEST_NAME and all(map(is_shown, text))


def _with(tag: Tag, values: Mapping[str, str]) -> Tag:
    attributes = {
        name: replace(a, text=values[a.node.id])
        if name.endswith(_ASKED) and a.node is not None and a.node.id in values
        else a
        for name, a in tag.attributes.items()
    }
    return replace(tag, attributes=attributes)
