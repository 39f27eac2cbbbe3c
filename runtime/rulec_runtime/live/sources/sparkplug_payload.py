"""The payload of Sparkplug B: metrics with names or aliases, as far as a reading needs them.

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
"""Bits and sign of data types; the wire knows whole numbers without a sign alone."""


@dataclass(frozen=True)
class Metric:
    """A metric of a message.

    `name` is empty where the alias alone stands for it; `number` what it holds, an int as on the
    wire, None if that is no number. `stamp` in s since 1970; `quality` is None where none is said.
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
        """The number; `kind` is the data type that its birth stated. NaN if there is none."""
        if self.null or self.number is None:
            return float("nan")
        if isinstance(self.number, float):
            return self.number
        bits, signed = _INTEGERS.get(self.kind or kind, (64, False))
        return float(whole(self.number, bits, signed=signed))


@dataclass(frozen=True)
class Message:
    """A payload: its stamp, s since 1970; its number in the sequence; its metrics."""

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
                metrics.append(_metric(inside(data)))
            elif number == 3:
                sequence = whole(data)
    except NoMessage as error:
        raise BadPayload(f"it is neither Sparkplug B nor JSON: {error}") from None
    return Message(stamp, sequence, tuple(metrics))


def _metric(data: bytes) -> Metric:
    known = ((_FIELDS[n], part) for n, part in fields(data) if n in _FIELDS)
    return Metric(**{name: read(part) for (name, read), part in known})


def _quality(data: int | bytes) -> int | None:
    """The property 'Quality' of a set: keys, and values in the same order."""
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
    """Sparkplug counts milliseconds."""
    return scaled(float(whole(data)), (1e3,))


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
"""What a field of a metric is, by its number, and how it is read."""
