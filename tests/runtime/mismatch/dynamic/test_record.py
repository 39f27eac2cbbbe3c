"""A recording as the analysis of a plant that stores reads it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.recordings.thin import glitches_in

from rulec.mismatch.evidence.failing_sensors import failing
from rulec.mismatch.evidence.stores.record import record_of
from rulec.mismatch.limits import BLOCKS, SAMPLE_BUDGET
from tests.runtime.mismatch.dynamic.benches import made, tanks


def test_blocks_follow_from_the_inputs_alone() -> None:
    """Other readings, the same split; a fifth is held out."""
    ruleset, builder = tanks()
    recording = made()
    other = replace(recording, values={**recording.values, "lower.y": recording.values["pump.u"]})
    first, second = (record_of(r, ruleset, builder.given) for r in (recording, other))
    assert first is not None
    assert second is not None
    assert first.digest == second.digest
    assert 0.15 < 1.0 - first.open.mean() < 0.25


def test_the_beginning_is_never_held_out() -> None:
    """What was stored at the first sample is a parameter, and shows there alone."""
    ruleset, builder = tanks()
    for shift in range(0, 200, 20):
        recording = made()
        values = {n: np.roll(v, shift) for n, v in recording.values.items()}
        record = record_of(replace(recording, values=values), ruleset, builder.given)
        assert record is not None
        assert record.open[: len(record.time) // BLOCKS].all()


def test_long_recordings_keep_the_volume_that_was_pumped() -> None:
    """Neighbours are averaged: what flowed in stays the same."""
    ruleset, builder = tanks()
    recording = made(3 * SAMPLE_BUDGET)
    record = record_of(recording, ruleset, builder.given)
    assert record is not None
    assert len(record.time) <= SAMPLE_BUDGET
    kept = recording.values["pump.u"][: 3 * len(record.time)]
    assert record.inputs["pump.u"].mean() == pytest.approx(kept.mean(), rel=1e-12)


@pytest.mark.parametrize("missing", ["pump.u", "lower.y"])
def test_without_input_or_reading_nothing_is_compared(missing: str) -> None:
    ruleset, builder = tanks()
    recording = made()
    values = {n: v for n, v in recording.values.items() if n != missing}
    assert record_of(replace(recording, values=values), ruleset, builder.given) is None


def test_gaps_in_an_input_hold_the_last_value() -> None:
    ruleset, builder = tanks()
    recording = made()
    holes = recording.values["pump.u"].copy()
    holes[100:103] = np.nan
    record = record_of(
        replace(recording, values={**recording.values, "pump.u": holes}), ruleset, builder.given
    )
    assert record is not None
    assert [holes[99]] * 3 == record.inputs["pump.u"][100:103].tolist()


def test_a_sensor_that_drops_out_is_told() -> None:
    """Single readings that jump away and back, often; a step of the level is none."""
    recording = made()
    y = recording.values["lower.y"].copy()
    odd = np.arange(20, 500, 12)
    y[odd] -= 4.0
    found = list(failing(replace(recording, values={"lower.y": y}), tanks()[0]))
    assert ["lower.y.drop-outs"] == [f.id for f in found]
    assert "sensor" == found[0].sort
    assert odd.tolist() == np.flatnonzero(glitches_in(y)).tolist()
    assert not list(failing(recording, tanks()[0]))
    assert not glitches_in(np.repeat([1.0, 5.0, 2.0], 50)).any()
