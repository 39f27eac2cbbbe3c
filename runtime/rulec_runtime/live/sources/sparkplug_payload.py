"""The payload of Sparkplug B: metrics with names or aliases, with the fields that readings need.

It is decoded from untrusted bytes in the wire format of Protocol Buffers. Sources: Protocol
Buffers, Encoding (protobuf.dev/programming-guides/encoding); Eclipse Sparkplug 3.0, section 6.4 and
sparkplug_b.proto.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Any

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.mqtt_payload import BadPayload, scaled


class Wire(IntEnum):
    """Wire types."""

    VARINT = 0
    EIGHT_BYTES = 1
    BYTES = 2
    FOUR_BYTES = 5


class NoMessage(ValueError):
    """The bytes are not a valid message."""


def fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Number and content of each field: an int for a varint, else bytes. Raises `NoMessage`.

    >>> [*fields(bytes([0x08, 0x96, 0x01, 0x12, 0x02, 0x68, 0x69]))]
    [(1, 150), (2, b'hi')]
    """
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        number, kind = tag >> 3, tag & 7
        if not number:
            raise NoMessage("a field has number 0")
        if kind == Wire.VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        if kind == Wire.BYTES:
            size, at = _varint(data, at)
        elif kind in (Wire.EIGHT_BYTES, Wire.FOUR_BYTES):
            size = 8 if kind == Wire.EIGHT_BYTES else 4
        else:
            raise NoMessage("a field is of an unknown kind")
        if size > len(data) - at:
            raise NoMessage("a field is longer than the message")
        yield number, data[at : at + size]
        at += size


def real(data: int | bytes) -> float:
    """The float in 4 or 8 bytes. Raises `NoMessage` for another field.

    >>> real(bytes.fromhex("0000c03f"))
    1.5
    """
    if not isinstance(data, bytes) or len(data) not in (4, 8):
        raise NoMessage("a number has another kind of field")
    (value,) = struct.unpack("<f" if len(data) == 4 else "<d", data)
    return float(value)


def whole(data: int | bytes, bits: int = 64, *, signed: bool = False) -> int:
    """The lowest bits of a varint. Raises `NoMessage` for another field.

    >>> whole(2**32 - 5, 32, signed=True), whole(251, 8, signed=True), whole(7)
    (-5, -5, 7)
    """
    if not isinstance(data, int):
        raise NoMessage("a whole number has another kind of field")
    value = data & ((1 << bits) - 1)
    return value - (1 << bits) if signed and value >> (bits - 1) else value


def words(data: int | bytes) -> str:
    """A text. Raises `NoMessage` for another field, or if it is not UTF-8."""
    try:
        return bytes.decode(data, "utf-8")  # type: ignore[arg-type]
    except (TypeError, UnicodeDecodeError):
        raise NoMessage("a name is no text") from None


def inside(data: int | bytes) -> bytes:
    """A nested message. Raises `NoMessage` for another field."""
    if not isinstance(data, bytes):
        raise NoMessage("a part has another kind of field")
    return data


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """An integer of at most 64 bits, and the position after it."""
    value = 0
    for i, byte in enumerate(data[at : at + limits.LONGEST_VARINT]):
        value |= (byte & 0x7F) << (7 * i)
        if byte < 0x80:
            return value & ((1 << 64) - 1), at + i + 1
    raise NoMessage("a number does not end")


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
