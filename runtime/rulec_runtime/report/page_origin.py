"""When a page was made, and by which tool."""

import os
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

EPOCH = "SOURCE_DATE_EPOCH"
"""Environment variable with the seconds since 1970 to use as now, for reproducible bytes."""


def made_now(distribution: str) -> str:
    """The present moment with its zone, and an installed distribution with its version."""
    given = os.environ.get(EPOCH, "")
    if given.isascii() and given.isdigit() and len(given) <= 11:
        now = datetime.fromtimestamp(int(given), UTC)
    else:
        now = datetime.now().astimezone()
    try:
        tool = f"{distribution} {version(distribution)}"
    except PackageNotFoundError:
        tool = distribution
    zone = f"{now:%z}"
    shown = f"UTC{zone[:3]}:{zone[3:5]}" if zone.strip("+-0") else "UTC"
    return f"{now:%Y-%m-%d %H:%M} {shown} by {tool}"
