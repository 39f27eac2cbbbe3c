"""What passes between an OPC UA server and us, without the package that carries it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rulec_runtime.live.sources.map import Channel


@dataclass(frozen=True)
class Message:
    """What a server published.

    `time` is when, s since 1970, None where it says none; `values` are those that changed, each
    with the index of its channel, as asyncua's DataValue; `over` says why there will be no more.
    """

    time: float | None
    values: Sequence[tuple[int, Any]]
    over: str


def node_of(channel: Channel) -> Any:
    """The node id of a channel, as asyncua has it. Raises `SourceRefused`."""
    from asyncua import ua

    try:
        return ua.NodeId.from_string(channel.address)
    except (ua.UaError, ValueError, TypeError):
        raise channel.refused(
            "this is no node id; write one such as ns=2;s=A.dp or ns=2;i=1001"
        ) from None
