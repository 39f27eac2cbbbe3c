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
    if not any(_uri(node) for node in nodes):
        return nodes
    known = [str(uri) for uri in await client.get_namespace_array()]
    found = []
    for channel, node in zip(channels, nodes, strict=True):
        own = numbered(node, known)
        if own is None:
            text = f"the server has no namespace '{_uri(node)}'; it has {', '.join(known[1:9])}"
            raise channel.refused(one_line(text))
        found.append(own)
    return found


def numbered(node: ua.NodeId, known: Sequence[str]) -> ua.NodeId | None:
    """A node with the number of its namespace among the `known`; None where it is not there."""
    uri = _uri(node)
    if uri is None:
        return node
    return ua.NodeId(node.Identifier, known.index(uri), node.NodeIdType) if uri in known else None


def _uri(node: ua.NodeId) -> str | None:
    return getattr(node, "NamespaceUri", None)
