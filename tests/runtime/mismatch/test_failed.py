"""Sensors that show what they cannot are told, though nothing can be compared with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.failing_sensors import impossible
from tests.runtime.mismatch.dynamic.benches import made, tanks
from tests.runtime.mismatch.made import alone, compared, recorded, tour


def below(recording: Recording, name: str, by: float, share: float = 1.0) -> Recording:
    """The recording with a reading too low for a share of the time."""
    values = recording.values[name].copy()
    values[: round(share * len(values))] -= by
    return replace(recording, values={**recording.values, name: values})


def test_a_power_below_zero_is_a_sensor_that_is_wrong() -> None:
    """With swapped wires a power meter reads less than nothing: that was "no mismatch" once."""
    recording = recorded(alone(), tour(alone()[0], 120))
    found = compared(alone(), below(recording, "A.P_el", 2000.0))
    assert "sensor" == found.verdict
    assert [("impossible-reading", "A", "P_el")] == [
        (f.name, f.module, f.place) for f in found.findings
    ]
    assert "120 of 120 readings lie outside of 0 to" in found.findings[0].text
    assert [("A", "P_el")] == [(p.module, p.place) for p in found.locations]


@pytest.mark.parametrize(("share", "told"), [(0.0, 0), (0.4, 0), (0.6, 1)])
def test_most_readings_must_be_out_of_range(share: float, told: int) -> None:
    """A few are left out, like single readings that jump."""
    recording = recorded(alone(), tour(alone()[0], 120))
    assert told == len(list(impossible(below(recording, "A.P_el", 2000.0, share), alone()[0])))


def test_plants_that_store_are_asked_too() -> None:
    """A level above the range of its sensor."""
    recording = made(200)
    assert not list(impossible(recording, tanks()[0]))
    high = replace(recording, values={**recording.values, "lower.y": np.full(200, 14.0)})
    assert ["lower.y.impossible-reading"] == [f.id for f in impossible(high, tanks()[0])]
