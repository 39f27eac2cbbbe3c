"""Numbers with stamps from the untrusted payload of an MQTT message: JSON, or Sparkplug B.

Sparkplug B has metrics with names or aliases, in the wire format of Protocol Buffers; the fields
that readings need are decoded. Sources: Protocol Buffers, Encoding
(protobuf.dev/programming-guides/encoding); Eclipse Sparkplug 3.0, section 6.4 and
sparkplug_b.proto.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
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
        if isinstance(found, str):
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


class NoMessage(ValueError):
    """The bytes are not a valid message."""


_WIRE_TYPES = {0: "varint", 1: "<d", 2: "bytes", 5: "<f"}
"""Kinds of fields; those of reals by their form."""

_OTHER = {
    str: "a name is no text",
    int: "a whole number has another kind of field",
    float: "a number has another kind of field",
    bytes: "a part has another kind of field",
}


def fields(data: bytes) -> Iterator[tuple[int, int | float | bytes]]:
    """Number and content of each field of a message: an int for a varint, a float for 4 or 8 bytes,
    else bytes. Raises `NoMessage`.

    >>> [*fields(bytes([0x08, 0x96, 0x01, 0x12, 0x02, 0x68, 0x69, 0x1D, 0, 0, 0xC0, 0x3F]))]
    [(1, 150), (2, b'hi'), (3, 1.5)]
    """
    at = 0

    def varint() -> int:
        nonlocal at
        value = 0
        for i, byte in enumerate(data[at : at + limits.LONGEST_VARINT]):
            value |= (byte & 0x7F) << (7 * i)
            if byte < 0x80:
                at += i + 1
                return value & ((1 << 64) - 1)
        raise NoMessage("a number does not end")

    while at < len(data):
        tag = varint()
        number, kind = tag >> 3, tag & 7
        if not number:
            raise NoMessage("a field has number 0")
        form = _WIRE_TYPES.get(kind)
        if form is None:
            raise NoMessage("a field is of an unknown kind")
        if form == "varint":
            yield number, varint()
            continue
        size = varint() if form == "bytes" else struct.calcsize(form)
        if size > len(data) - at:
            raise NoMessage("a field is longer than the message")
        part, at = data[at : at + size], at + size
        yield number, part if form == "bytes" else struct.unpack(form, part)[0]


def _named(data: bytes, names: Mapping[int, tuple[str, type]]) -> Iterator[tuple[str, Any]]:
    """Name and content of the fields that are named, by number. Raises `NoMessage` for one of
    another type, or if a text is not UTF-8."""
    for number, part in fields(data):
        if number not in names:
            continue
        name, kind = names[number]
        content: int | float | bytes | str = part
        if kind is str and isinstance(part, bytes):
            with suppress(UnicodeDecodeError):
                content = part.decode("utf-8")
        if type(content) is not kind:
            raise NoMessage(_OTHER[kind])
        yield name, content


_PAYLOAD = {1: ("stamp", int), 2: ("metric", bytes), 3: ("sequence", int)}
_METRIC = {
    **{1: ("name", str), 2: ("alias", int), 3: ("stamp", int), 4: ("kind", int)},
    **{5: ("historical", int), 7: ("null", int), 9: ("quality", bytes)},
    **dict.fromkeys((10, 11, 14), ("number", int)),
    **dict.fromkeys((12, 13), ("number", float)),
}
_PROPERTIES = {1: ("key", str), 2: ("value", bytes)}
_PROPERTY = dict.fromkeys((3, 4), ("number", int))
_INTEGERS = {
    **{1: (8, True), 2: (16, True), 3: (32, True), 4: (64, True)},
    **{5: (8, False), 6: (16, False), 7: (32, False), 8: (64, False)},
}
"""Bits and sign of data types; integers on the wire are unsigned."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A metric of a message.

    `name` is empty if only the alias is given; `number` is the value, an int as on the wire, None
    if it is not a number. `stamp` in s since 1970; `quality` is None if not given.
    """

    name: str = ""
    alias: int | None = None
    stamp: float | None = None
    kind: int = 0
    historical: int = 0
    null: int = 0
    quality: int | None = None
    number: int | float | None = None

    def value(self, kind: int = 0) -> float:
        """The number, NaN without one; `kind` is the data type from its birth."""
        if self.null or self.number is None:
            return float("nan")
        if isinstance(self.number, float):
            return self.number
        bits, signed = _INTEGERS.get(self.kind or kind, (64, False))
        number = self.number & ((1 << bits) - 1)
        return float(number - (1 << bits) if signed and number >> (bits - 1) else number)


@dataclass(frozen=True)
class Message:
    """A payload: its stamp, s since 1970, its sequence number, and its metrics."""

    stamp: float | None
    metrics: tuple[Metric, ...]
    sequence: int | None = None


def message_of(payload: bytes) -> Message:
    """Read a payload. Raises `BadPayload`."""
    if len(payload) > limits.LARGEST_MESSAGE:
        raise BadPayload(f"more than {limits.LARGEST_MESSAGE} bytes")
    own, metrics = dict[str, Any](), []
    try:
        for name, part in _named(payload, _PAYLOAD):
            if name == "metric":
                metrics.append(_metric(dict(_named(part, _METRIC))))
            else:
                own[name] = part
    except NoMessage as error:
        raise BadPayload(f"it is neither Sparkplug B nor JSON: {error}") from None
    return Message(metrics=tuple(metrics), **_stamped(own))


def _metric(own: dict[str, Any]) -> Metric:
    if "quality" in own:  # properties: keys, and values in the same order
        parts = [*_named(own.pop("quality"), _PROPERTIES)]
        keys, values = ([p for name, p in parts if name == kind] for kind in ("key", "value"))
        if "Quality" in keys[: len(values)]:
            value = values[keys.index("Quality")]
            own["quality"] = dict(_named(value, _PROPERTY)).get("number", 0)
    return Metric(**_stamped(own))


def _stamped(own: dict[str, Any]) -> dict[str, Any]:
    """The fields with a stamp in s instead of ms."""
    return own | {"stamp": scaled(float(own["stamp"]), (1e3,)) if "stamp" in own else None}
