"""Read some nodes of an OPC UA server once, without subscriptions, writes or calls."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence

from asyncua import ua

from rulec_runtime.live.sources.map import Server
from rulec_runtime.live.sources.opcua_nodes import attributes_of, namespaces_of, numbered
from rulec_runtime.live.sources.opcua_session import bounded, connected, discard


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
        return [_text(next(values)) if node is not None else "" for node in nodes]
    finally:
        await discard(client)


def _node(text: str, uris: Sequence[str]) -> ua.NodeId | None:
    try:
        return numbered(ua.NodeId.from_string(text), uris)
    except (ua.UaError, ValueError, TypeError):
        return None


def _text(value: ua.DataValue) -> str:
    good = value.StatusCode is not None and value.StatusCode.is_good()
    held = value.Value.Value if good and value.Value is not None else None
    return "" if held is None else str(held).strip()
