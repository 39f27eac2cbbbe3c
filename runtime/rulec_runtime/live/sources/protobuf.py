"""Decode the wire format of Protocol Buffers from untrusted bytes.

Source: Protocol Buffers, Encoding (protobuf.dev/programming-guides/encoding).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from enum import IntEnum

from rulec_runtime.live.sources import limits


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
