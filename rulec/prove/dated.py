"""Dates for recordings that have seconds: together they then stand on one axis of time."""

from __future__ import annotations

from datetime import datetime, timedelta

BEGAN = datetime(2026, 1, 5, 6)
"""When every first recording began."""


def dated(text: str) -> str:
    """A recording, as CSV, with dates in the place of seconds since the first one began."""
    head, *rows = text.splitlines()
    lines = [f"time,{head.partition(',')[2]}"]
    for row in rows:
        seconds, _, rest = row.partition(",")
        date = BEGAN + timedelta(seconds=round(float(seconds)))
        lines.append(f"{date.isoformat(sep=' ')},{rest}")
    return "\n".join(lines) + "\n"
