"""Numbers with stamps from the untrusted payload of an MQTT message."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from math import isfinite
from typing import Any

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.map import Channel
from rulec_runtime.output.json_file import Damaged, parse_json

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
        return limits.GOOD_QUALITY <= quality < 256
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
