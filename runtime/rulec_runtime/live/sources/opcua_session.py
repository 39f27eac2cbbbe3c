"""One connection to an OPC UA server, from its first message to its last; never revived.

Services used: those that open and close a session, Read, Browse, CreateSubscription,
CreateMonitoredItems, Publish. Nothing writes or calls.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from asyncua import Client, ua
from asyncua.crypto import security_policies, uacrypto

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.abandon import abandon, bounded
from rulec_runtime.live.sources.map import Channel, Server
from rulec_runtime.live.sources.opcua_message import Message
from rulec_runtime.live.sources.opcua_nodes import nodes_of


async def connected(server: Server) -> Client:
    """A client with a session. Raises what asyncua raises; then there is nothing to close."""
    client = Client(server.endpoint, timeout=limits.REQUEST)
    client.name = "rulec watch"
    access = server.access
    if access.user:
        client.set_user(access.user)
        client.set_password(access.password)
    try:
        if access.policy:
            await bounded(_secured(client, server), 2 * limits.REQUEST)
        await bounded(client.connect(), 2 * limits.REQUEST)
    except BaseException:
        await discard(client)
        raise
    return client


async def _secured(client: Client, server: Server) -> None:
    access = server.access
    assert access.certificate is not None
    own = await uacrypto.load_certificate(access.certificate)
    with contextlib.suppress(uacrypto.x509.ExtensionNotFound):
        names = own.extensions.get_extension_for_class(uacrypto.x509.SubjectAlternativeName).value
        uris = names.get_values_for_type(uacrypto.x509.UniformResourceIdentifier)
        client.application_uri = uris[0] if uris else client.application_uri
    await client.set_security(
        getattr(security_policies, f"SecurityPolicy{access.policy.replace('_', '')}"),
        str(access.certificate),
        str(access.key),
        server_certificate=str(access.server_certificate) if access.server_certificate else None,
        mode=getattr(ua.MessageSecurityMode, access.mode),
    )


async def subscribed(
    client: Client,
    channels: Sequence[Channel],
    interval: float,
    published: Callable[[Message], None],
) -> float:
    """Subscribe to all channels; gives the s from message to message that the server grants.

    Where nothing changes, the server says that it is alive once per publishing interval.
    """
    nodes = await nodes_of(client, channels)
    parameters = ua.CreateSubscriptionParameters()
    parameters.RequestedPublishingInterval = interval * 1000
    parameters.RequestedLifetimeCount = 10_000
    parameters.RequestedMaxKeepAliveCount = 1
    parameters.PublishingEnabled = True

    granted = await client.uaclient.create_subscription(
        parameters, lambda result: published(_message(result))
    )
    step = max(granted.RevisedPublishingInterval / 1000, interval)
    for i in range(0, len(nodes), limits.NODES_PER_CALL):
        asked = ua.CreateMonitoredItemsParameters()
        asked.SubscriptionId = granted.SubscriptionId
        asked.TimestampsToReturn = ua.TimestampsToReturn.Both
        asked.ItemsToCreate = [
            _item(nodes[k], k, interval)
            for k in range(i, min(i + limits.NODES_PER_CALL, len(nodes)))
        ]
        results = await client.uaclient.create_monitored_items(asked)
        for k, result in enumerate(results, i):
            if not result.StatusCode.is_good():
                raise channels[k].refused(f"it cannot be subscribed: {result.StatusCode.name}")
    return float(step * max(1, granted.RevisedMaxKeepAliveCount))


def _item(node: ua.NodeId, handle: int, interval: float) -> ua.MonitoredItemCreateRequest:
    item = ua.MonitoredItemCreateRequest()
    item.ItemToMonitor.NodeId = node
    item.ItemToMonitor.AttributeId = ua.AttributeIds.Value
    item.MonitoringMode = ua.MonitoringMode.Reporting
    item.RequestedParameters.ClientHandle = handle
    item.RequestedParameters.SamplingInterval = interval * 1000
    item.RequestedParameters.QueueSize = 1
    item.RequestedParameters.DiscardOldest = True
    return item


def _message(result: ua.PublishResult) -> Message:
    over = ""
    values: list[tuple[int, ua.DataValue]] = []
    for part in result.NotificationMessage.NotificationData or ():
        if isinstance(part, ua.DataChangeNotification):
            values += [(int(i.ClientHandle), i.Value) for i in part.MonitoredItems]
        elif isinstance(part, ua.StatusChangeNotification):
            over = f"the subscription ended: {part.Status.name}"
    return Message(seconds(result.NotificationMessage.PublishTime), values, over)


def seconds(stamp: datetime | None) -> float | None:
    """A stamp as s since 1970; None where there is none."""
    if stamp is None:
        return None
    try:
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    except (OverflowError, ValueError):
        return None


def number(value: ua.DataValue | None) -> tuple[float, str]:
    """The number of a value that is good, else NaN and the name of its quality."""
    if value is None or value.Value is None or value.Value.Value is None:
        status = value.StatusCode if value is not None else None
        bad = status is not None and not status.is_good()
        return float("nan"), str(status.name) if bad and status is not None else "no value"
    if value.StatusCode is not None and not value.StatusCode.is_good():
        return float("nan"), str(value.StatusCode.name)
    try:
        return float(value.Value.Value), ""
    except (TypeError, ValueError, OverflowError):
        return float("nan"), "no number"


async def discard(client: Client) -> None:
    """Close a client if it lets itself be closed in time, else abandon it with its socket."""
    with contextlib.suppress(Exception):
        await bounded(client.disconnect(), limits.CLOSING)
    inner: Mapping[str, Any] = vars(client)
    for name in ("_supervisor_task", "_stale_watchdog_task", "_renew_channel_task"):
        task = inner.get(name)
        if isinstance(task, asyncio.Task) and not task.done():
            abandon(task)
    publishing = client.uaclient._publish_task
    if publishing is not None and not publishing.done():
        abandon(publishing)
    transport = getattr(client.uaclient.protocol, "transport", None)
    if transport is not None:
        transport.abort()
