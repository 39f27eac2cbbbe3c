"""One connection to an OPC UA server, which is never reused.

Services used: those that open and close a session, Read, Browse, CreateSubscription,
CreateMonitoredItems, Publish. Nothing writes or calls.

Under packet loss a client of asyncua may hang for ever, even when cancelled (its issues 70, 1072,
1660). So nothing here waits for a cancelled task.
"""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar

from asyncua import Client, ua
from asyncua.crypto import security_policies, uacrypto

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import Channel, Server
from rulec_runtime.live.sources.remarks import SourceRefused

T = TypeVar("T")

_ABANDONED: set[asyncio.Task[Any]] = set()
"""Abandoned tasks; a running task without a reference may be garbage-collected."""


@dataclass(frozen=True)
class Message:
    """A message of a server.

    `time` is its time of publishing, s since 1970, or None; `values` are the changed ones, each
    with the index of its channel; `over` says why the subscription has ended.
    """

    time: float | None
    values: Sequence[tuple[int, ua.DataValue]]
    over: str


async def connected(server: Server) -> Client:
    """A client with an open session. Closes it on errors, which are those of asyncua."""
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
    _check_dates(server, client)


def _check_dates(server: Server, client: Client) -> None:
    """Raises `SourceRefused` for an expired certificate, unless the map accepts that."""
    if server.access.expired:
        return
    policy = client.security_policy
    whose = {"its": policy.peer_certificate, "this computer's own": policy.host_certificate}
    for name, data in whose.items():
        one = uacrypto.x509_from_der(data)
        if not one.not_valid_before_utc <= datetime.now(UTC) <= one.not_valid_after_utc:
            raise SourceRefused(
                f"{server.endpoint}: {name} certificate is valid from "
                f"{one.not_valid_before_utc:%Y-%m-%d} to {one.not_valid_after_utc:%Y-%m-%d} only; "
                "renew it, or write 'expired: accept' below 'security:'"
            )


def parts_of(items: Sequence[T]) -> list[Sequence[T]]:
    """Parts of a list for requests small enough for small controllers."""
    most = limits.NODES_PER_CALL
    return [items[i : i + most] for i in range(0, len(items), most)]


async def subscribed(
    client: Client, interval: float, published: Callable[[Message], None]
) -> tuple[int, float]:
    """The id of a subscription, and the interval of messages that the server grants, s.

    Without changes the server sends a keep-alive message once per publishing interval.
    """
    parameters = ua.CreateSubscriptionParameters(
        RequestedPublishingInterval=interval * 1000,
        RequestedLifetimeCount=10_000,
        RequestedMaxKeepAliveCount=1,
        PublishingEnabled=True,
    )
    granted = await client.uaclient.create_subscription(
        parameters, lambda result: published(_message(result))
    )
    step = max(granted.RevisedPublishingInterval / 1000, interval)
    return granted.SubscriptionId, float(step * max(1, granted.RevisedMaxKeepAliveCount))


async def monitored(
    client: Client, subscription: int, nodes: Mapping[int, ua.NodeId], interval: float
) -> dict[int, str]:
    """Subscribe to nodes, given by the index of their channel; returns the failures by index."""
    failed, of_value, every = {}, ua.AttributeIds.Value, interval * 1000
    for part in parts_of([*nodes]):
        items = [
            ua.MonitoredItemCreateRequest(
                ua.ReadValueId(NodeId=nodes[k], AttributeId=of_value),
                ua.MonitoringMode.Reporting,
                ua.MonitoringParameters(
                    ClientHandle=k, SamplingInterval=every, QueueSize=1, DiscardOldest=True
                ),
            )
            for k in part
        ]
        asked = ua.CreateMonitoredItemsParameters(subscription, ua.TimestampsToReturn.Both, items)
        results = await client.uaclient.create_monitored_items(asked)
        for k, result in zip(part, results, strict=True):
            if not result.StatusCode.is_good():
                failed[k] = f"it cannot be subscribed: {result.StatusCode.name}"
    return failed


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
    """A stamp as s since 1970, or None."""
    if stamp is None:
        return None
    try:
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    except (OverflowError, ValueError):
        return None


def is_gone(value: ua.DataValue) -> bool:
    """Whether the status of a value means that its node no longer exists."""
    return value.StatusCode is not None and value.StatusCode.value in (
        ua.StatusCodes.BadNodeIdUnknown,
        ua.StatusCodes.BadNodeIdInvalid,
    )


def number(value: ua.DataValue, channel: Channel) -> tuple[float, str]:
    """The number of a value, or NaN and why it is unusable."""
    none, status = float("nan"), value.StatusCode
    if is_gone(value):
        return none, f"the node is gone ({status.name})"
    if status is not None and not status.is_good():
        if status.value >> 30 != limits.UNCERTAIN:
            return none, str(status.name)
        if not channel.uncertain:
            return none, f"{status.name}; write 'uncertain: accept' at the signal to use it"
    content: Any = None if value.Value is None else value.Value.Value
    if isinstance(content, list | tuple):
        what = f"an array of {len(content)} values"
        if channel.index is None:
            return none, f"{what}; write 'index: 0' at the signal for the first"
        if channel.index >= len(content):
            return none, f"{what} has none at index {channel.index}"
        content = content[channel.index]
    if content is None:
        return none, "no value"
    return (float(content), "") if isinstance(content, int | float) else (none, "no number")


async def discard(client: Client) -> None:
    """Close a client; if that takes too long, abandon it and abort its socket."""
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


async def bounded(work: Coroutine[Any, Any, T], seconds: float) -> T:
    """The result of work. Raises TimeoutError, or ConnectionError if it cancelled itself."""
    task = asyncio.ensure_future(work)
    try:
        await asyncio.wait({task}, timeout=seconds)
    finally:
        if not task.done():
            abandon(task)
    if not task.done():
        raise TimeoutError(f"no answer within {seconds:g} s")
    if task.cancelled():
        raise ConnectionError("the connection was closed")
    return task.result()


def abandon(task: asyncio.Task[Any]) -> None:
    """Cancel a task without waiting for it."""
    _ABANDONED.add(task)
    task.add_done_callback(_ended)
    task._log_destroy_pending = False  # type: ignore[attr-defined] # it may never end
    task.cancel()


def _ended(task: asyncio.Task[Any]) -> None:
    _ABANDONED.discard(task)
    if not task.cancelled():
        task.exception()  # otherwise the loop would report that it was never retrieved
