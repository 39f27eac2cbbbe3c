"""Numbers with stamps from the untrusted payload of an MQTT message: JSON, or Sparkplug B.

Sparkplug B has metrics with names or aliases, in the wire format of Protocol Buffers; the fields
that readings need are decoded. Sources: Protocol Buffers, Encoding
(protobuf.dev/programming-guides/encoding); Eclipse Sparkplug 3.0, section 6.4 and
sparkplug_b.proto.
"""

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import IntEnum
from functools import partial
from math import isfinite
from typing import Any

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import Channel
from rulec_runtime.output.json_file import Damaged, parse_json
from rulec_runtime.recordings.limits import GOOD_QUALITY

STAMPS = ("time", "timestamp", "ts", "t")
"""Keys of a stamp, tried in this order if the map has none."""


class BadPayload(ValueError):
    """The message cannot be used; the text does not quote it."""


@dataclass(frozen=True)
class Value:
    """A number as sent, or NaN, and why it is `bad`; its stamp, s since 1970, or None."""

    number: float
    stamp: float | None
    bad: str = ""


def values_of(
    payload: bytes, channels: Sequence[Channel], stamp_key: str = ""
) -> list[tuple[Channel, Value]]:
    """The values in a message for the channels of its topic. Raises `BadPayload`.

    Forms: a bare number; ``{"value", "timestamp", "quality"}``; an object with a number, or such
    an object, per name; ``{"timestamp", "metrics": [{"name", "value", "timestamp"}]}``.
    """
    if len(payload) > limits.LARGEST_MESSAGE:
        raise BadPayload(f"more than {limits.LARGEST_MESSAGE} bytes")
    try:
        data = parse_json(payload.decode("utf-8"))
    except UnicodeDecodeError:
        raise BadPayload(
            "it is not UTF-8 text (Sparkplug B is read from topics that begin with spBv1.0/)"
        ) from None
    except (Damaged, ValueError, RecursionError):
        raise BadPayload("it is not JSON") from None
    metrics = data.get("metrics") if isinstance(data, dict) else None
    named = (m for m in metrics if isinstance(m, dict)) if isinstance(metrics, list) else ()
    parts = {m["name"]: m for m in named if isinstance(m.get("name"), str)}
    found = []
    keys = (stamp_key,) if stamp_key else STAMPS
    whole = _stamp(data, keys) if isinstance(data, dict) else None
    for channel in channels:
        if not channel.name:
            found.append((channel, _value(data, keys, whole)))
        elif not isinstance(data, dict):
            raise BadPayload("an object with names is needed")
        elif channel.name in parts:
            found.append((channel, _value(parts[channel.name], keys, whole)))
        elif "metrics" not in data and channel.name in data:
            found.append((channel, _value(data[channel.name], keys, whole)))
    if not found:
        raise BadPayload("none of the names of the map stands in it")
    return found


def _value(data: Any, keys: Sequence[str], whole: float | None) -> Value:
    if isinstance(data, dict):
        stamp = _stamp(data, keys)
        stamp = whole if stamp is None else stamp
        bad = "" if is_good(data.get("quality")) and not data.get("is_null") else "bad quality"
        number = _number(data.get("value"))
    else:
        stamp, bad, number = whole, "", _number(data)
    if not isfinite(number):
        bad = bad or "no number"
    return Value(float("nan") if bad else number, stamp, bad)


def _number(data: Any) -> float:
    if isinstance(data, bool | int | float):
        try:
            return float(data)
        except OverflowError:
            return float("nan")
    return float("nan")


def is_good(quality: Any) -> bool:
    """Whether a value of this quality, or without any, may be used."""
    if quality is None or quality is True:
        return True
    if isinstance(quality, str):
        return quality.strip().lower() in ("good", "ok")
    if isinstance(quality, int | float) and not isinstance(quality, bool):
        return GOOD_QUALITY <= quality < 256
    return False


def _stamp(data: dict[str, Any], keys: Sequence[str]) -> float | None:
    """Seconds since 1970 from a number of s, ms, us or ns, or an ISO 8601 date."""
    for key in keys:
        found = data.get(key)
        if isinstance(found, bool) or found is None:
            continue
        if isinstance(found, int | float):
            return scaled(float(found)) if abs(found) < 1e300 else None
        if isinstance(found, str) and len(found) < limits.LONGEST_STAMP:
            try:
                date = datetime.fromisoformat(found.strip())
                return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
            except (ValueError, OverflowError):
                return None
    return None


def scaled(number: float, units: Sequence[float] = (1.0, 1e3, 1e6, 1e9)) -> float | None:
    """Seconds of a count of s, ms, us or ns, which are unambiguous from 2001 to 2286."""
    for unit in units:
        if limits.EARLIEST <= number / unit < limits.LATEST:
            return number / unit
    return None


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
                stamp = _milliseconds(data)
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


def _milliseconds(data: int | bytes) -> float | None:
    return scaled(float(whole(data)), (1e3,))  # milliseconds


def _flag(data: int | bytes) -> bool:
    return bool(whole(data))


_FIELDS: Mapping[int, tuple[str, Callable[[int | bytes], Any]]] = {
    1: ("name", words),
    2: ("alias", whole),
    3: ("stamp", _milliseconds),
    4: ("kind", partial(whole, bits=32)),
    5: ("historical", _flag),
    7: ("null", _flag),
    9: ("quality", _quality),
    **dict.fromkeys((10, 11, 14), ("number", whole)),
    **dict.fromkeys((12, 13), ("number", real)),
}
"""Name and reader of the fields of a metric, by number."""
