"""What began, what is active, what ended: the parts of a diagnosis that last, each with a name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["fault", "sensor", "regime", "unknown", "blind", "source"]
"""A known fault; a reading that is none; a way of running such as dry; what no known fault
explains; what cannot be judged; the connection to the plant."""

What = Literal["began", "changed", "ended", "withdrawn", "noted"]
"""`withdrawn`: later readings explain it otherwise; `noted`: told once, nothing that lasts."""


@dataclass(frozen=True, kw_only=True)
class Episode:
    """Something that was told and lasts; times in s, as of rows.

    `id` stays the same from its beginning to its end. `subject` is the fault, the reading with its
    condition, the regime, or empty. Degrees are those of
    `rulec_runtime.diagnosis.steady.findings.Finding`, 1 where there is none. `status` is the
    letter of NE 107. `grows` says where it is going, for people, `growth` the same as JSON data,
    `rate` is per second. `told` are time and degree of when an event told of it last.
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
    """A change of an episode; `number` counts them from 1 on, `time` is that of the last row that
    had come, s; `text` says what is new, for people."""

    number: int
    time: float
    what: What
    text: str
    episode: Episode
