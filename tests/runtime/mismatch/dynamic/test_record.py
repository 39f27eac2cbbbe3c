"""A recording as the analysis of a plant that stores reads it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.thin import glitches_in

from rulec.mismatch.evidence.failing_sensors import failing
from rulec.mismatch.evidence.stores.record import Record, record_of
from rulec.mismatch.limits import BLOCKS, SAMPLE_BUDGET
from tests.runtime.mismatch.dynamic.benches import made, tanks
from tests.runtime.mismatch.made import changed, without


def read(recording: Recording) -> Record:
    record = record_of(recording, tanks()[0], tanks()[1].given)
    assert record is not None
    return record


def test_blocks_follow_from_the_inputs_alone() -> None:
    """Other readings, the same split; a fifth is held out, but never the beginning: what was stored
    at the first sample is a parameter, and shows there alone."""
    recording = made()
    first = read(recording)
    other = read(changed(recording, {"lower.y": recording.values["pump.u"]}))
    assert first.digest == other.digest
    assert 0.15 < 1.0 - first.open.mean() < 0.25
    for shift in range(0, 200, 20):
        moved = {n: np.roll(v, shift) for n, v in recording.values.items()}
        record = read(replace(recording, values=moved))
        assert record.open[: len(record.time) // BLOCKS].all()


def test_long_recordings_keep_the_volume_that_was_pumped() -> None:
    """Neighbours are averaged: what flowed in stays the same."""
    recording = made(3 * SAMPLE_BUDGET)
    record = read(recording)
    assert len(record.time) <= SAMPLE_BUDGET
    kept = recording.values["pump.u"][: 3 * len(record.time)]
    assert record.inputs["pump.u"].mean() == pytest.approx(kept.mean(), rel=1e-12)


def test_what_is_missing() -> None:
    """Without input or reading nothing is compared; gaps in an input hold the last value."""
    recording = made()
    for missing in ("pump.u", "lower.y"):
        assert record_of(without(recording, missing), tanks()[0], tanks()[1].given) is None
    holes = recording.values["pump.u"].copy()
    holes[100:103] = np.nan
    record = read(changed(recording, {"pump.u": holes}))
    assert [holes[99]] * 3 == record.inputs["pump.u"][100:103].tolist()


def test_a_sensor_that_drops_out_is_told() -> None:
    """Single readings that jump away and back, often; a step of the level is none."""
    recording = made()
    y = recording.values["lower.y"].copy()
    odd = np.arange(20, 500, 12)
    y[odd] -= 4.0
    (found,) = failing(replace(recording, values={"lower.y": y}), tanks()[0])
    assert ("lower.y.drop-outs", "sensor") == (found.id, found.sort)
    assert odd.tolist() == np.flatnonzero(glitches_in(y)).tolist()
    assert not list(failing(recording, tanks()[0]))
    assert not glitches_in(np.repeat([1.0, 5.0, 2.0], 50)).any()
