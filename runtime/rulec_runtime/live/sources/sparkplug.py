"""Sparkplug B: edge nodes and devices with births, aliases, and numbered messages.

Nothing is ever sent, so no rebirth is requested: values identified only by alias are read from the
next birth on. Source: Eclipse Sparkplug 3.0.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, nan

from rulec_runtime.live.rows import NoticeKind
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import Channel
from rulec_runtime.live.sources.mqtt_payload import Message, Metric, Value, is_good, message_of

NAMESPACE = "spBv1.0"
_DATA, _BIRTHS, _DEATHS = ("NDATA", "DDATA"), ("NBIRTH", "DBIRTH"), ("NDEATH", "DDEATH")

Address = tuple[str, str, str]
"""Group, edge node, device; the device is empty for the node itself."""

Remark = tuple[NoticeKind, str, str]
"""Kind, key and text of a recurring remark; keys contain only names of the map."""


@dataclass
class _Node:
    """State of an edge node: metrics by alias, data types by metric, the last message number."""

    metric_of: dict[int, tuple[Address, str]] = field(default_factory=dict)
    kind_of: dict[tuple[Address, str], int] = field(default_factory=dict)
    last: int | None = None


@dataclass(frozen=True)
class Heard:
    """Content of a message: values of channels, and remarks.

    `living` are senders without new values, whose values hold; `gone` are lost ones.
    """

    values: Sequence[tuple[Channel, Value]] = ()
    remarks: Sequence[Remark] = ()
    living: Iterable[str] = ()
    gone: Iterable[str] = ()


class Sparkplug:
    """The channels of a map with Sparkplug topics. Raises `SourceRefused` for an invalid topic, or
    a channel without the name of a metric."""

    def __init__(self, channels: Iterable[Channel]) -> None:
        self._channels: dict[tuple[Address, str], list[Channel]] = {}
        for channel in channels:
            if channel.address.partition("/")[0] == NAMESPACE:
                own = self._channels.setdefault((_address(channel), channel.name), [])
                own.append(channel)
        self._nodes = {node[:2]: _Node() for node, _ in self._channels}

    @property
    def topics(self) -> list[str]:
        """Topics to subscribe to: all messages of the nodes, as they are numbered."""
        return [f"{NAMESPACE}/{group}/+/{node}/#" for group, node in self._nodes]

    @property
    def sender_of(self) -> dict[str, str]:
        """The device of each signal."""
        every = self._channels.items()
        return {c.signal.id: _sender(a) for (a, _), found in every for c in found}

    def hears(self, topic: str) -> bool:
        """Whether a topic belongs to one of these nodes."""
        kind, address = _parts(topic)
        return bool(kind) and address[:2] in self._nodes

    def heard(self, topic: str, payload: bytes) -> Heard:
        """Take in a message of such a topic. Raises `BadPayload`."""
        kind, address = _parts(topic)
        node, name = self._nodes[address[:2]], "/".join(address[:2])
        senders = {_sender(a) for a, _ in self._channels if a[:2] == address[:2]}
        if kind in _DEATHS:
            gone = senders if kind == "NDEATH" else senders & {_sender(address)}
            text = f"{_sender(address)} says that it is gone ({kind})"
            return Heard(gone=gone, remarks=[("gap", text, text)] if gone else ())
        if kind not in (*_DATA, *_BIRTHS):
            return Heard()  # a command
        message = message_of(payload)
        remarks = _gap(node, kind, name, message)
        gone = set()
        if kind in _BIRTHS:
            self._born(node, kind, address, message)
            # Values missing from a birth are unknown until their own birth.
            gone = senders if kind == "NBIRTH" else senders & {_sender(address)}
        values = []
        for metric in message.metrics:
            own, why = self._values(node, address, metric)
            stamp = message.stamp if metric.stamp is None or kind in _BIRTHS else metric.stamp
            values += [(channel, replace(value, stamp=stamp)) for channel, value in own]
            remarks += [("refused", text, text) for text in why]
        return Heard(values, remarks, senders, gone)

    def _born(self, node: _Node, kind: str, address: Address, message: Message) -> None:
        """Aliases and data types of a birth replace earlier ones; an alias is unique within the
        node."""
        stays = kind == "DBIRTH"
        node.metric_of = {a: m for a, m in node.metric_of.items() if stays and m[0] != address}
        node.kind_of = {m: k for m, k in node.kind_of.items() if stays and m[0] != address}
        for metric in message.metrics:
            key = (address, metric.name)
            if metric.alias is not None:
                node.metric_of.pop(metric.alias, None)
            if key in self._channels:
                node.kind_of[key] = metric.kind
                if metric.alias is not None:
                    node.metric_of[metric.alias] = key

    def _values(
        self, node: _Node, address: Address, metric: Metric
    ) -> tuple[Sequence[tuple[Channel, Value]], Sequence[str]]:
        """Values of channels in a metric, without its stamp, and reasons for omissions."""
        key = (address, metric.name)
        if not metric.name and metric.alias is not None:
            unborn = any(k[0] == address and k not in node.kind_of for k in self._channels)
            key = node.metric_of.get(metric.alias, key)
            if not key[1] or metric.kind not in (0, node.kind_of[key]):
                text = f"{_sender(address)}: values come by alias; they are read from its birth on"
                return (), (text,) if unborn else ()
        if key[0] != address or key not in self._channels:
            return (), ()
        if metric.historical:
            text = f"{_sender(address)}: values that it kept while it was cut off are left out"
            return (), (text,)
        bad = "" if is_good(metric.quality) else "bad quality"
        number = metric.value(node.kind_of.get(key, 0))
        if not isfinite(number):
            bad = bad or "no number"
        value = Value(nan if bad else number, None, bad)
        return [(channel, value) for channel in self._channels[key]], ()


def _gap(node: _Node, kind: str, name: str, message: Message) -> list[Remark]:
    """A remark if messages are missing before this one; a node birth restarts the numbers."""
    before, node.last = node.last, message.sequence
    if before is None or message.sequence is None or kind == "NBIRTH":
        return []
    if message.sequence == (before + 1) % limits.SEQUENCE:
        return []
    text = f"{name}: message {message.sequence} follows {before}; what is between is missing"
    return [("gap", f"{name} gap", text)]


def _parts(topic: str) -> tuple[str, Address]:
    """Kind and sender of a message; empty for a topic that is not Sparkplug."""
    space, *rest = topic.split("/", 4)
    if space != NAMESPACE or len(rest) < 3:
        return "", ("", "", "")
    group, kind, node, *device = rest
    return kind, (group, node, device[0] if device else "")


def _sender(address: Address) -> str:
    """Name of a node or device, for people and as a sender of values."""
    return "/".join(address).rstrip("/")


def _address(channel: Channel) -> Address:
    """The sender of a channel, from a data or birth topic."""
    kind, address = _parts(channel.address)
    wanted = (_DATA[1], _BIRTHS[1]) if address[2] else (_DATA[0], _BIRTHS[0])
    if kind not in wanted or not all(address[:2]) or "/" in address[2]:
        raise channel.refused(
            f"a topic of Sparkplug is {NAMESPACE}/GROUP/NDATA/NODE or "
            f"{NAMESPACE}/GROUP/DDATA/NODE/DEVICE"
        )
    if not channel.name:
        raise channel.refused("a topic of Sparkplug needs 'name:', that of the metric")
    return address
