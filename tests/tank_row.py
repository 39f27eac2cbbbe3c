"""For tests of the truth of tanks: a plant of three tanks, units, instruments without errors."""

from __future__ import annotations

from dataclasses import replace

from rulec.prove.truth.tanks import Layout
from rulec.prove.truth.tanks.build import LITRE_PER_HOUR, Setup
from rulec.prove.truth.tanks.plant import Plant

SI = {"cm": 1e-2, "cm2": 1e-4, "cm3/s/V": 1e-6, "V/cm": 100.0}

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
"""The inflow metered, two levels measured."""


def without_errors(setup: Setup) -> Plant:
    """The plant with instruments that have no systematic error."""
    plant = setup.plant
    gain = LITRE_PER_HOUR if setup.layout.metered else plant.feed.gain
    sensors = tuple(replace(s, zero=0.0) for s in plant.sensors)
    return replace(plant, feed=replace(plant.feed, zero=0.0, gain=gain), sensors=sensors)
