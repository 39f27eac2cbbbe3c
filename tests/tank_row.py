"""A plant for tests of the truth of tanks: three tanks, the inflow metered, two levels measured."""

from __future__ import annotations

from rulec.prove.truth.tanks import Layout

ROW = Layout(
    "tank-row",
    "inflow",
    ("first", "middle", "last"),
    ("first", "last"),
    True,
    5.0,
    "F1 [l/h]",
    {"first": "L1 [V]", "last": "L3 [V]"},
)
