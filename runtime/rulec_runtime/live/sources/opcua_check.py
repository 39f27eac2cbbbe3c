"""Whether nodes of an OPC UA server are what the map takes them for: numbers, and their units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asyncua import Client, ua

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import Channel, conversion
from rulec_runtime.live.sources.opcua_nodes import attributes_of
from rulec_runtime.live.sources.opcua_session import is_gone
from rulec_runtime.output.terminal import one_line
from rulec_runtime.recordings.reading_unit import parse_unit

_UNITS = "EngineeringUnits"
_KINDS = ua.VariantType
_NUMBERS = {
    ua.ObjectIds.Number,
    ua.ObjectIds.Integer,
    ua.ObjectIds.UInteger,
    *(k.value for k in _KINDS if _KINDS.Boolean.value <= k.value <= _KINDS.Double.value),
}
"""Data types of namespace 0 that are numbers: built-in ones, and those they are derived from."""


async def scales_of(
    client: Client, channels: Sequence[Channel], nodes: Sequence[ua.NodeId], ruleset: Ruleset
) -> tuple[list[tuple[float, float] | str], list[str]]:
    """Factor and offset of each channel: SI = number * factor + offset; what was assumed.

    In place of them, why a node cannot be read: it is missing, no number, or in a unit of another
    kind.
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
            name = _type_name(type_of.Value.Value)
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
    """Which of the nodes the server has no more, by their places."""
    classes = await attributes_of(client, nodes, ua.AttributeIds.NodeClass)
    return {i for i, one in enumerate(classes) if is_gone(one)}


async def _types(client: Client, nodes: Sequence[ua.NodeId]) -> list[ua.DataValue]:
    """The data type of each node; where it may hold anything, that of what it holds now."""
    types = await attributes_of(client, nodes, ua.AttributeIds.DataType)
    any_type = ua.NodeId(ua.ObjectIds.BaseDataType)
    open_ones = [
        i for i, t in enumerate(types) if t.StatusCode.is_good() and t.Value.Value == any_type
    ]
    values = await attributes_of(client, [nodes[i] for i in open_ones], ua.AttributeIds.Value)
    for i, value in zip(open_ones, values, strict=True):
        # A node that holds nothing yet may hold a number later; what comes is looked at anyway.
        kind = _KINDS.Double if value.Value is None else value.Value.VariantType
        kind = _KINDS.Double if kind == _KINDS.Null else kind
        types[i] = ua.DataValue(ua.Variant(ua.NodeId(kind.value)))
    return types


def _scale(channel: Channel, unit: str, ruleset: Ruleset, notes: list[str]) -> tuple[float, float]:
    """Of the unit in the map, else of the server's; where both are known they must agree.

    Raises ValueError with what is wrong.
    """
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
        if ours is not None and (ours.dimension, ours.offset) != (theirs.dimension, theirs.offset):
            raise ValueError(f"the map says {stated}, but the server says {unit}")
        if ours is not None and abs(ours.factor / theirs.factor - 1) > limits.SAME_UNIT:
            raise ValueError(f"the map says {stated}, but the server says {unit}")
    if not stated:
        notes.append(f"{signal.id} names no unit; {signal.unit} is assumed")
    factor, offset = conversion(signal, stated, ruleset)
    return channel.scale * factor, channel.offset * factor + offset


async def _units(client: Client, nodes: Sequence[ua.NodeId]) -> list[str]:
    """The text of the property EngineeringUnits of each node, empty where there is none."""
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
            found = [r.NodeId for r in result.References or () if r.BrowseName.Name == _UNITS]
            units.append(found[0] if found else None)
    known = [unit for unit in units if unit is not None]
    values = iter(await attributes_of(client, known, ua.AttributeIds.Value) if known else [])
    return [_unit_text(next(values)) if unit is not None else "" for unit in units]


def _unit_text(value: ua.DataValue) -> str:
    information: Any = value.Value.Value if value.Value is not None else None
    text = getattr(getattr(information, "DisplayName", None), "Text", None)
    return str(text).strip() if text else ""


async def _is_number(client: Client, type_id: ua.NodeId) -> bool:
    """Whether a data type is a number, or derived from one."""
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


def _type_name(type_id: ua.NodeId) -> str:
    if type_id.NamespaceIndex == 0 and isinstance(type_id.Identifier, int):
        name = ua.ObjectIdNames.get(type_id.Identifier)
        return str(name) if name else type_id.to_string()
    return one_line(type_id.to_string())
