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
from rulec_runtime.live.sources.opcua_session import bounded, connected, discard, is_gone
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
    for i in range(0, len(nodes), limits.NODES_PER_CALL):
        part = list(nodes[i : i + limits.NODES_PER_CALL])
        found += await client.uaclient.read_attributes(part, attribute)
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


_KINDS = ua.VariantType
_NUMBERS = {
    ua.ObjectIds.Number,
    ua.ObjectIds.Integer,
    ua.ObjectIds.UInteger,
    *(k.value for k in _KINDS if _KINDS.Boolean.value <= k.value <= _KINDS.Double.value),
}
"""Numeric data types of namespace 0: built-in ones, and their base types."""


async def scales_of(
    client: Client, channels: Sequence[Channel], nodes: Sequence[ua.NodeId], ruleset: Ruleset
) -> tuple[list[tuple[float, float] | str], list[str]]:
    """Factor and offset of each channel, SI = number * factor + offset, and notes on assumptions.

    For a node that cannot be read, the reason instead: it is missing, not a number, or in a unit of
    another dimension.
    """
    types = await _types(client, nodes)
    ranks = await attributes_of(client, nodes, ua.AttributeIds.ValueRank)
    units = await _units(client, nodes)
    scales: list[tuple[float, float] | str] = []
    notes: list[str] = []
    for channel, type_of, rank, unit in zip(channels, types, ranks, units, strict=True):
        if not type_of.StatusCode.is_good():
            scales.append(
                f"the server answers {type_of.StatusCode.name}; look the node up in its address "
                "space"
            )
        elif not await _is_number(client, type_of.Value.Value):
            kind = type_of.Value.Value
            name = one_line(kind.to_string())
            if kind.NamespaceIndex == 0 and isinstance(kind.Identifier, int):
                name = ua.ObjectIdNames.get(kind.Identifier) or name
            scales.append(f"the node holds {name}; a number is needed")
        elif channel.index is None and rank.StatusCode.is_good() and rank.Value.Value >= 0:
            scales.append(
                "the node holds an array; write 'index: 0' at the signal for its first number"
            )
        else:
            try:
                scales.append(_scale(channel, unit, ruleset, notes))
            except ValueError as error:
                scales.append(one_line(str(error)))
    return scales, notes


async def gone_of(client: Client, nodes: Sequence[ua.NodeId]) -> set[int]:
    """Indices of the nodes that the server no longer has."""
    classes = await attributes_of(client, nodes, ua.AttributeIds.NodeClass)
    return {i for i, one in enumerate(classes) if is_gone(one)}


async def _types(client: Client, nodes: Sequence[ua.NodeId]) -> list[ua.DataValue]:
    """The data type of each node; for a node of any type, that of its present value."""
    types = await attributes_of(client, nodes, ua.AttributeIds.DataType)
    any_type = ua.NodeId(ua.ObjectIds.BaseDataType)
    open_ones = [
        i for i, t in enumerate(types) if t.StatusCode.is_good() and t.Value.Value == any_type
    ]
    values = await attributes_of(client, [nodes[i] for i in open_ones], ua.AttributeIds.Value)
    for i, value in zip(open_ones, values, strict=True):
        # An empty node may hold a number later; all values are checked anyway.
        kind = _KINDS.Double if value.Value is None else value.Value.VariantType
        kind = _KINDS.Double if kind == _KINDS.Null else kind
        types[i] = ua.DataValue(ua.Variant(ua.NodeId(kind.value)))
    return types


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
    asked = []
    for node in nodes:
        properties = ua.BrowseDescription()
        properties.NodeId = node
        properties.BrowseDirection = ua.BrowseDirection.Forward
        properties.ReferenceTypeId = ua.NodeId(ua.ObjectIds.HasProperty)
        properties.IncludeSubtypes = True
        properties.ResultMask = ua.BrowseResultMask.BrowseName
        asked.append(properties)
    units: list[ua.NodeId | None] = []
    for i in range(0, len(asked), limits.NODES_PER_CALL):
        parameters = ua.BrowseParameters()
        parameters.NodesToBrowse = asked[i : i + limits.NODES_PER_CALL]
        parameters.RequestedMaxReferencesPerNode = 0
        for result in await client.uaclient.browse(parameters):
            found = (
                r.NodeId for r in result.References or () if r.BrowseName.Name == "EngineeringUnits"
            )
            units.append(next(found, None))
    known = [unit for unit in units if unit is not None]
    values = iter(await attributes_of(client, known, ua.AttributeIds.Value) if known else [])
    return [_unit_text(next(values)) if unit is not None else "" for unit in units]


def _unit_text(value: ua.DataValue) -> str:
    information: Any = value.Value.Value if value.Value is not None else None
    text = getattr(getattr(information, "DisplayName", None), "Text", None)
    return str(text).strip() if text else ""


async def _is_number(client: Client, type_id: ua.NodeId) -> bool:
    """Whether a data type is numeric, or derived from a numeric one."""
    for _ in range(limits.DEEPEST_TYPE):
        if type_id.NamespaceIndex == 0 and type_id.Identifier in _NUMBERS:
            return True
        parents = await client.get_node(type_id).get_referenced_nodes(
            ua.ObjectIds.HasSubtype, ua.BrowseDirection.Inverse
        )
        if not parents:
            return False
        type_id = parents[0].nodeid
    return False


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
    held = value.Value.Value if good and value.Value is not None else None
    return "" if held is None else str(held).strip()
