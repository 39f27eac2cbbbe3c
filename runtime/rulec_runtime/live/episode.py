"""Episodes, the lasting parts of a diagnosis, and events, their changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["fault", "sensor", "regime", "unknown", "blind", "source"]
"""A known fault; a faulty sensor; an operating regime such as dry running; a deviation without a
known fault; what cannot be judged; the connection to the plant."""

What = Literal["began", "changed", "ended", "withdrawn", "noted"]
"""`withdrawn`: later readings explain it otherwise; `noted`: reported once, does not last."""


@dataclass(frozen=True, kw_only=True)
class Episode:
    """A reported condition that lasts; times in s, as of rows.

    `id` does not change. `subject` is the fault, the sensor with its condition, the regime, or
    empty. Degrees are those of `rulec_runtime.diagnosis.steady.findings.Finding`, 1 without one.
    `status` is the letter of NE 107. `grows` describes the growth for people, `growth` is the same
    as JSON data, `rate` is per second. `told` are time and degree of the last event about it.
    """

    id: str
    kind: Kind
    subject: str
    module: str
    status: str
    since: float
    until: float
    active: bool
    text: str
    action: str = ""
    degree: float = 1.0
    lower: float = 1.0
    upper: float = 1.0
    unit: str = ""
    probability: float = 1.0
    alternatives: tuple[tuple[str, float], ...] = ()
    grows: str = ""
    rate: float = 0.0
    growth: Mapping[str, Any] = field(default_factory=dict)
    told: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Event:
    """A change of an episode; `number` counts from 1, `time` is that of the last row received, s;
    `text` says what is new, for people."""

    number: int
    time: float
    what: What
    text: str
    episode: Episode
