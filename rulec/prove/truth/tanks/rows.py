"""Rows of tanks drawn from a seed: their number, names, feed and sensors."""

from __future__ import annotations

from ..streams import stream
from .build import Layout

NAMES = (
    ("upper", "centre", "lower", "bottom"),
    ("north", "east", "south", "west"),
    ("T1", "T2", "T3", "T4"),
    ("settling", "buffer", "storage", "sump"),
)

FEEDS = ("pump", "supply", "P1")
MAINS = ("mains", "inflow", "F1")

FEWEST, MOST = 2, 4
"""Tanks in a row."""

ALSO_MEASURED = 0.4
"""Probability that a tank above the last one is also measured."""

METERED = 0.4
"""Probability that a flow meter shows the feed, instead of the voltage of a pump."""

INTERVALS = (3.0, 4.0, 5.0)
"""s"""


def row(seed: int) -> Layout:
    """Draw a row of tanks; the last one is measured, as nothing else depends on it."""
    random = stream(seed, "row")
    count = int(random.integers(FEWEST, MOST + 1))
    tanks = NAMES[int(random.integers(len(NAMES)))][:count]
    seen = random.uniform(size=count - 1) < ALSO_MEASURED
    measured = (*(t for t, also in zip(tanks[:-1], seen, strict=True) if also), tanks[-1])
    metered = bool(random.uniform() < METERED)
    feed = (MAINS if metered else FEEDS)[int(random.integers(len(FEEDS)))]
    interval = float(random.choice(INTERVALS))
    columns = {tank: f"L{tanks.index(tank) + 1} [V]" for tank in measured}
    inlet = "F [l/h]" if metered else "u [V]"
    return Layout(f"row-{seed}", feed, tanks, measured, metered, interval, inlet, columns)
