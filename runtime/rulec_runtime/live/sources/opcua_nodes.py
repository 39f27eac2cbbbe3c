"""Nodes of a map with the present namespace numbers of a server, which may change at its start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from asyncua import Client, ua

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import Channel
from rulec_runtime.output.terminal import one_line


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


def nodes_of(
    channels: Sequence[Channel], uris: Sequence[str], known: Mapping[str, str]
) -> list[ua.NodeId]:
    """The node of each channel on a server with these namespaces.

    A map names a namespace by its URI or by a number. A number stands for the URI that it had when
    the server was first read, if that is `known`. Raises `SourceRefused` if the server has no such
    namespace.
    """
    found = []
    for channel in channels:
        node = node_of(channel)
        own = numbered(node, uris, known)
        if own is None:
            here = f"it has {', '.join(uris[1:9])}"
            text = f"the server has no namespace '{_uri(node)}'; {here}"
            if _uri(node) is None:
                text = (
                    f"the server has no namespace '{known[str(node.NamespaceIndex)]}' any more, "
                    f"which ns={node.NamespaceIndex} was when it was read first; {here}. Is it "
                    "another server? If not, name the namespace in the map: nsu=URI;..."
                )
            raise channel.refused(one_line(text))
        found.append(own)
    return found


def numbered(
    node: ua.NodeId, uris: Sequence[str], known: Mapping[str, str] | None = None
) -> ua.NodeId | None:
    """A node with the number of its namespace among the `uris`; None if it is not there.

    `known` as in `nodes_of`.
    """
    uri = _uri(node) or (known or {}).get(str(node.NamespaceIndex))
    if uri is None:
        return node
    if uri not in uris:
        return None
    here = node.NamespaceIndex
    number = here if list(uris[here : here + 1]) == [uri] else uris.index(uri)
    return ua.NodeId(node.Identifier, number, node.NodeIdType)


def _uri(node: ua.NodeId) -> str | None:
    return getattr(node, "NamespaceUri", None)
