"""Read from the controller the units and ranges that a package leaves to it."""

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
    """The package with the current values of its servers; failures become oddities.

    `endpoint`, if not empty, replaces the one in the file. Raises `SourceRefused` if the OPC UA
    package is not installed.
    """
    extra("asyncua", "opcua")
    values: dict[str, str] = {}
    odd: list[Oddity] = []
    for server in package.servers:
        asked = list(
            dict.fromkeys(
                a.node.id
                for tag in package.tags
                for name, a in tag.attributes.items()
                if name.endswith(_ASKED) and a.node is not None and a.node.server == server.name
            )
        )
        address = endpoint or server.endpoint
        if asked and address:
            values |= _read(package, address, asked, odd)
    tags = tuple(_with(tag, values) for tag in package.tags)
    return replace(package, tags=tags, odd=(*package.odd, *odd))


def _read(
    package: Package, address: str, asked: Sequence[str], odd: list[Oddity]
) -> Mapping[str, str]:
    from rulec_runtime.live.sources.opcua_once import read_once

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


def _with(tag: Tag, values: Mapping[str, str]) -> Tag:
    attributes = {
        name: replace(a, text=values[a.node.id])
        if name.endswith(_ASKED) and a.node is not None and a.node.id in values
        else a
        for name, a in tag.attributes.items()
    }
    return replace(tag, attributes=attributes)
