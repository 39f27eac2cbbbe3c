"""Nodes of a map as one server numbers them: a map may name a namespace by its URI."""

from __future__ import annotations

from collections.abc import Sequence

from asyncua import Client, ua

from rulec_runtime.live.sources.map import Channel
from rulec_runtime.live.sources.opcua_message import node_of
from rulec_runtime.output.terminal import one_line


async def nodes_of(client: Client, channels: Sequence[Channel]) -> list[ua.NodeId]:
    """The node of each channel. Raises `SourceRefused` where the server lacks its namespace.

    Numbers of namespaces may change whenever a server starts; URIs stay.
    """
    nodes = [node_of(channel) for channel in channels]
    named = [getattr(node, "NamespaceUri", None) for node in nodes]
    if not any(named):
        return nodes
    known = [str(uri) for uri in await client.get_namespace_array()]
    return [
        node if uri is None else _numbered(channel, node, uri, known)
        for channel, node, uri in zip(channels, nodes, named, strict=True)
    ]


def _numbered(channel: Channel, node: ua.NodeId, uri: str, known: Sequence[str]) -> ua.NodeId:
    if uri not in known:
        listed = ", ".join(known[1:9])
        raise channel.refused(one_line(f"the server has no namespace '{uri}'; it has {listed}"))
    return ua.NodeId(node.Identifier, known.index(uri), node.NodeIdType)
