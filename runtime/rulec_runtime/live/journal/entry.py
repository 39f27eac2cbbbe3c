"""An event as a journal gives it back."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.live.episode import Event


@dataclass(frozen=True)
class Entry:
    """An event of a plant; `iso` is its time in UTC, None where times have no date. Who has taken
    note of its episode, and when, s since 1970; None if nobody has."""

    plant: str
    event: Event
    iso: str | None
    by: str | None
    at: float | None
