"""A recording as the analysis of a plant that stores reads it, and sensors that fail in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.recordings.columns import glitches_in, runs_of_same
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import standing_still

from rulec.mismatch.evidence.failing_sensors import coarse_step, failing
from rulec.mismatch.evidence.stores.simulation_problem import Record, record_of
from rulec.mismatch.limits import BLOCKS, SAMPLE_BUDGET
from tests.runtime.mismatch.dynamic.benches import made, tanks
from tests.runtime.mismatch.made import changed, without

COURSE = 3.0 + np.sin(np.arange(600) / 40.0)
NOISY = np.round(COURSE + 0.02 * np.random.default_rng(1).standard_normal(600), 3)


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


def test_a_reading_that_loses_its_noise_is_stuck() -> None:
    for behind in (215, 260):
        stuck = NOISY.copy()
        stuck[200:behind] = stuck[200]
        assert [(200, behind)] == standing_still(stuck)


def test_a_reading_that_is_often_the_same_is_not_stuck() -> None:
    """Noise of a third of a step repeats itself by chance, for 25 readings here; a smooth course
    that is rounded stands still by itself, and so does a clipped one; as does a plateau on which
    noise is half a digit, after one on which it is three digits."""
    quiet = np.round(3.0 + 0.35 * np.random.default_rng(2).standard_normal(600))
    rest = np.round(np.minimum(COURSE, 3.4), 2)
    rest = np.concatenate([rest, np.full(100, rest[-1])])
    random = np.random.default_rng(4)
    loud, faint = random.normal(0.0, 3.0, 600), random.normal(0.0, 0.22, 600)
    plateau = np.round(np.concatenate([100.0 + loud, 120.0 + faint]))
    assert max(b - a for a, b in runs_of_same(plateau, 1)[0]) > 40
    for values in (NOISY, quiet, rest, np.minimum(NOISY, 3.4), plateau):
        assert standing_still(values) == []


def test_a_coarse_display_is_told_by_its_step() -> None:
    many = np.round(3.0 * NOISY / 0.1) * 0.1
    assert len(np.unique(many)) > 40
    assert coarse_step(np.round(NOISY / 0.4) * 0.4, 0.025) == pytest.approx(0.4)
    assert coarse_step(many, 0.01) == pytest.approx(0.1)
    assert coarse_step(NOISY, 0.025) == 0.0
    assert coarse_step(np.where(COURSE > 3.0, 1.0, 0.0), 0.025) == 0.0
