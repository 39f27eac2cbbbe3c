"""The payload of Sparkplug B: metrics with names or aliases, with the fields that readings need.

Source: Eclipse Sparkplug 3.0, section 6.4 and sparkplug_b.proto.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.mqtt_payload import BadPayload, scaled
from rulec_runtime.live.sources.protobuf import NoMessage, fields, inside, real, whole, words

_INTEGERS = {
    **{1: (8, True), 2: (16, True), 3: (32, True), 4: (64, True)},
    **{5: (8, False), 6: (16, False), 7: (32, False), 8: (64, False)},
}
"""Bits and sign of data types; integers on the wire are unsigned."""


@dataclass(frozen=True)
class Metric:
    """A metric of a message.

    `name` is empty if only the alias is given; `number` is the value, an int as on the wire, None
    if it is not a number. `stamp` in s since 1970; `quality` is None if not given.
    """

    name: str = ""
    alias: int | None = None
    stamp: float | None = None
    kind: int = 0
    historical: bool = False
    null: bool = False
    quality: int | None = None
    number: int | float | None = None

    def value(self, kind: int = 0) -> float:
        """The number, NaN without one; `kind` is the data type from its birth."""
        if self.null or self.number is None:
            return float("nan")
        if isinstance(self.number, float):
            return self.number
        bits, signed = _INTEGERS.get(self.kind or kind, (64, False))
        return float(whole(self.number, bits, signed=signed))


@dataclass(frozen=True)
class Message:
    """A payload: its stamp, s since 1970, its sequence number, and its metrics."""

    stamp: float | None
    sequence: int | None
    metrics: tuple[Metric, ...]


def message_of(payload: bytes) -> Message:
    """Read a payload. Raises `BadPayload`."""
    if len(payload) > limits.LARGEST_MESSAGE:
        raise BadPayload(f"more than {limits.LARGEST_MESSAGE} bytes")
    stamp, sequence, metrics = None, None, []
    try:
        for number, data in fields(payload):
            if number == 1:
                stamp = _stamp(data)
            elif number == 2:
                parts = fields(inside(data))
                known = ((_FIELDS[n], part) for n, part in parts if n in _FIELDS)
                metrics.append(Metric(**{name: read(part) for (name, read), part in known}))
            elif number == 3:
                sequence = whole(data)
    except NoMessage as error:
        raise BadPayload(f"it is neither Sparkplug B nor JSON: {error}") from None
    return Message(stamp, sequence, tuple(metrics))


def _quality(data: int | bytes) -> int | None:
    """The property 'Quality' of a property set: keys, and values in the same order."""
    keys, values = [], []
    for number, part in fields(inside(data)):
        if number == 1:
            keys.append(words(part))
        elif number == 2:
            values.append(inside(part))
    for key, value in zip(keys, values, strict=False):
        if key == "Quality":
            numbers = [whole(part) for number, part in fields(value) if number in (3, 4)]
            return numbers[-1] if numbers else 0
    return None


def _stamp(data: int | bytes) -> float | None:
    return scaled(float(whole(data)), (1e3,))  # milliseconds


def _flag(data: int | bytes) -> bool:
    return bool(whole(data))


_FIELDS: Mapping[int, tuple[str, Callable[[int | bytes], Any]]] = {
    1: ("name", words),
    2: ("alias", whole),
    3: ("stamp", _stamp),
    4: ("kind", partial(whole, bits=32)),
    5: ("historical", _flag),
    7: ("null", _flag),
    9: ("quality", _quality),
    **dict.fromkeys((10, 11, 14), ("number", whole)),
    **dict.fromkeys((12, 13), ("number", real)),
}
"""Name and reader of the fields of a metric, by number."""
