"""Nodes of an OPC UA server: their present namespace numbers, which may change at its start, their
values, and whether they match the map: numbers, with the same units."""

import asyncio
import logging
from collections.abc import Sequence
from typing import Any

from asyncua import Client, ua

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import Channel, Server
from rulec_runtime.live.sources.opcua_session import bounded, connected, discard, is_gone, parts_of
from rulec_runtime.output.terminal import one_line
from rulec_runtime.recordings.reading_unit import conversion, parse_unit


def node_of(channel: Channel) -> ua.NodeId:
    """The node id of a channel. Raises `SourceRefused`."""
    try:
        return ua.NodeId.from_string(channel.address)
    except (ua.UaError, ValueError, TypeError):
        raise channel.refused(
            "this is no node id; write one such as ns=2;s=A.dp or ns=2;i=1001"
        ) from None


async def attributes_of(
    client: Client, nodes: Sequence[ua.NodeId], attribute: ua.AttributeIds
) -> list[ua.DataValue]:
    """An attribute of each node, read in requests small enough for small controllers."""
    found: list[ua.DataValue] = []
    for part in parts_of(nodes):
        found += await client.uaclient.read_attributes([*part], attribute)
    return found


async def namespaces_of(client: Client) -> list[str]:
    """The namespace URIs of a server, in the order of their numbers."""
    return [str(uri) for uri in await client.get_namespace_array() or ()]


async def nodes_of(client: Client, channels: Sequence[Channel]) -> list[ua.NodeId]:
    """The node of each channel; a map names its namespace by a number or by its URI, whose number
    may change. Raises `SourceRefused` if the server has no such namespace."""
    uris = await namespaces_of(client)
    found = []
    for channel in channels:
        node = node_of(channel)
        own = numbered(node, uris)
        if own is None:
            here = f"it has {', '.join(uris[1:9])}"
            text = f"the server has no namespace '{node.NamespaceUri}'; {here}"
            raise channel.refused(one_line(text))
        found.append(own)
    return found


def numbered(node: ua.NodeId, uris: Sequence[str]) -> ua.NodeId | None:
    """A node with the number of its namespace among the `uris`; None if it is not there."""
    uri = getattr(node, "NamespaceUri", None)
    if uri is None:
        return node
    if uri not in uris:
        return None
    return ua.NodeId(node.Identifier, uris.index(uri), node.NodeIdType)


async def scales_of(
    client: Client, channels: Sequence[Channel], nodes: Sequence[ua.NodeId], ruleset: Ruleset
) -> tuple[list[tuple[float, float] | str], list[str]]:
    """Factor and offset of each channel, SI = number * factor + offset, and notes on assumptions.

    For a node that cannot be read, the reason instead: it is missing, its value is not a number, or
    in a unit of another dimension.
    """
    values = await attributes_of(client, nodes, ua.AttributeIds.Value)
    units = await _units(client, nodes)
    scales: list[tuple[float, float] | str] = []
    notes: list[str] = []
    for channel, value, unit in zip(channels, values, units, strict=True):
        try:
            scales.append(_unfit(value, channel) or _scale(channel, unit, ruleset, notes))
        except ValueError as error:
            scales.append(one_line(str(error)))
    return scales, notes


def _unfit(value: ua.DataValue, channel: Channel) -> str:
    """Why the value of a node is no reading; empty if it may be one, or come later."""
    if is_gone(value):
        name = value.StatusCode.name
        return f"the server answers {name}; look the node up in its address space"
    content: Any = None if value.Value is None else value.Value.Value
    if isinstance(content, list | tuple):
        if channel.index is None:
            return "the node holds an array; write 'index: 0' at the signal for its first number"
        content = content[channel.index] if channel.index < len(content) else None
    if content is None or isinstance(content, int | float):
        return ""
    return f"the node holds {value.Value.VariantType.name}; a number is needed"


async def gone_of(client: Client, nodes: Sequence[ua.NodeId]) -> set[int]:
    """Indices of the nodes that the server no longer has."""
    classes = await attributes_of(client, nodes, ua.AttributeIds.NodeClass)
    return {i for i, one in enumerate(classes) if is_gone(one)}


def _scale(channel: Channel, unit: str, ruleset: Ruleset, notes: list[str]) -> tuple[float, float]:
    """Factor and offset of the unit in the map, else of the server; if both are known they must
    agree. Raises ValueError."""
    signal, raw = channel.signal, (channel.scale, channel.offset) != (1.0, 0.0)
    stated = channel.unit
    theirs = parse_unit(unit, ruleset.units) if unit else None
    if not stated and unit and not raw:
        if theirs is None:
            raise ValueError(
                f"the server gives its unit as '{unit[:40]}', which is not known; "
                f"state the unit in the map, as in 'unit: {signal.unit}'"
            )
        stated = unit
    elif stated and theirs is not None and not raw:
        ours = parse_unit(stated, ruleset.units)
        if ours is not None and (
            (ours.dimension, ours.offset) != (theirs.dimension, theirs.offset)
            or abs(ours.factor / theirs.factor - 1) > limits.SAME_UNIT
        ):
            raise ValueError(f"the map says {stated}, but the server says {unit}")
    if not stated:
        notes.append(f"{signal.id} names no unit; {signal.unit} is assumed")
    factor, offset = conversion(signal, stated, ruleset.units)
    return channel.scale * factor, channel.offset * factor + offset


async def _units(client: Client, nodes: Sequence[ua.NodeId]) -> list[str]:
    """The text of the property EngineeringUnits of each node; empty without one."""
    of_property = ua.NodeId(ua.ObjectIds.HasProperty)
    mask, forward = ua.BrowseResultMask.BrowseName, ua.BrowseDirection.Forward
    asked = [
        ua.BrowseDescription(node, forward, of_property, IncludeSubtypes=True, ResultMask=mask)
        for node in nodes
    ]
    units: list[ua.NodeId | None] = []
    for part in parts_of(asked):
        for result in await client.uaclient.browse(ua.BrowseParameters(NodesToBrowse=[*part])):
            named = {r.BrowseName.Name: r.NodeId for r in result.References or ()}
            units.append(named.get("EngineeringUnits"))
    known = [unit for unit in units if unit is not None]
    values = iter(await attributes_of(client, known, ua.AttributeIds.Value) if known else [])
    return [_unit_text(next(values)) if unit is not None else "" for unit in units]


def _unit_text(value: ua.DataValue) -> str:
    information: Any = value.Value.Value if value.Value is not None else None
    text = getattr(getattr(information, "DisplayName", None), "Text", None)
    return str(text).strip() if text else ""


def read_once(server: Server, ids: Sequence[str], seconds: float) -> list[str]:
    """The value of each node as text, empty without a good one.

    Raises ConnectionError if the server does not answer in time.
    """
    logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)  # it logs what servers send
    try:
        return asyncio.run(bounded(_read(server, ids), seconds))
    except Exception as error:  # asyncua raises errors of every kind
        text = str(error).strip() or type(error).__name__
        raise ConnectionError(text) from None


async def _read(server: Server, ids: Sequence[str]) -> list[str]:
    client = await connected(server)
    try:
        uris = await namespaces_of(client)
        nodes = [_node(text, uris) for text in ids]
        asked = [node for node in nodes if node is not None]
        values = iter(await attributes_of(client, asked, ua.AttributeIds.Value))
        return [_value_text(next(values)) if node is not None else "" for node in nodes]
    finally:
        await discard(client)


def _node(text: str, uris: Sequence[str]) -> ua.NodeId | None:
    try:
        return numbered(ua.NodeId.from_string(text), uris)
    except (ua.UaError, ValueError, TypeError):
        return None


def _value_text(value: ua.DataValue) -> str:
    good = value.StatusCode is not None and value.StatusCode.is_good()
    content = value.Value.Value if good and value.Value is not None else None
    return "" if content is None else str(content).strip()
