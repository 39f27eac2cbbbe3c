"""Step 0: settled points, what their blocks serve for, and recordings with holes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.limits import POINT_BUDGET
from rulec.mismatch.evidence.samples import ESTIMATION, HELDOUT, PATTERN, SELECTION
from rulec.mismatch.evidence.steady.prepare import prepare
from tests.runtime.mismatch.made import (
    HOLD,
    alone,
    compared,
    prepared,
    recorded,
    sampled,
    tour,
)

SAMPLES = 300


@pytest.fixture(scope="module")
def run() -> Recording:
    """A healthy recording."""
    return recorded(alone(), tour(alone()[0], SAMPLES))


def test_points_are_split_by_blocks(run: Recording) -> None:
    """All points of a block serve for one thing, blocks follow each other, every fifth is shut, and
    the sentence counts them. No point is an average over a change of the speed."""
    data = prepared(alone()[0], run)
    assert np.all(np.diff(data.block) >= 0)
    parts = [set(data.part[data.block == b].tolist()) for b in np.unique(data.block)]
    assert [{PATTERN[b % len(PATTERN)]} for b in range(len(parts))] == parts
    assert np.ptp(np.bincount(data.block)) <= 1
    assert np.array_equal(data.open, data.part != HELDOUT)
    assert not data.of_rows
    counts = [int((data.part == p).sum()) for p in (ESTIMATION, SELECTION, HELDOUT)]
    expected = "{} for estimation, {} for selection, {} held out (every fifth block)"
    assert expected.format(*counts) in data.split
    assert data.split.startswith(f"{len(data)} settled points in 25 blocks of time")
    speed, plateaus = data.values["A.n"], tour(alone()[0], SAMPLES)["A.n"][::HOLD]
    nearest = np.abs(speed[:, None] - plateaus).min(axis=1)
    assert nearest.max() < 0.01 * speed.min()


def test_asked_spans_are_held_out_and_nothing_else(run: Recording) -> None:
    """Points inside are shut, all others open, and no block has points of two kinds. The same
    recording gives the same hash, another split another one."""
    data = prepared(alone()[0], run, (60.0, 90.0), (200.0, 220.0))
    inside = ((data.time >= 60) & (data.time <= 90)) | ((data.time >= 200) & (data.time <= 220))
    assert np.array_equal(inside, data.part == HELDOUT)
    for block in np.unique(data.block):
        assert 1 == len(set(data.part[data.block == block].tolist()))
    assert {ESTIMATION, SELECTION, HELDOUT} == set(data.part.tolist())
    assert "held out (as asked)" in data.split
    first, again = (prepared(alone()[0], run).digest for _ in range(2))
    assert first == again != data.digest


def test_long_recordings_are_averaged(run: Recording) -> None:
    """Points times observers stay within the budget, and averages have less noise."""
    rules, _ = alone()
    held = {"A.n": np.repeat(tour(rules, 25 * HOLD)["A.n"][::HOLD], 800)}
    data = prepared(rules, recorded(alone(), held))
    assert len(data) * len(rules.observers) <= 1.5 * POINT_BUDGET
    single = prepared(rules, run).noise["A.dp"]
    assert np.median(data.noise["A.dp"]) < 0.75 * np.median(single)


def test_a_table_of_points_has_a_point_per_row(run: Recording) -> None:
    """One row per operating point; the noise is that of the sensors' classes."""
    rows = np.arange(HOLD // 2, SAMPLES, HOLD)
    data = prepared(alone()[0], sampled({name: v[rows] for name, v in run.values.items()}))
    assert data.of_rows
    assert len(rows) == len(data)
    for name, noise in data.noise.items():
        assert 0.3 * data.points.systematic[name] == pytest.approx(noise), name


def test_gaps_and_lost_readings_are_left_out(run: Recording) -> None:
    """A pause and a time without readings leave settled points on either side, none inside."""
    lost = (run.time >= 100) & (run.time < 130)
    values = {n: np.where(lost, np.nan, v) for n, v in run.values.items()}
    late = replace(run, time=np.where(run.time >= 200, run.time + 5000.0, run.time), values=values)
    data = prepared(alone()[0], late)
    usable = np.isfinite(data.values["A.dp"])
    assert not np.any((data.time[usable] > 101) & (data.time[usable] < 129))
    assert not np.any((data.time > 200) & (data.time < 5200))
    assert np.any(data.time > 5200)


def test_nothing_settled_cannot_be_judged(run: Recording) -> None:
    """Two samples are no stretch; the answer says what to record."""
    short = sampled({n: v[:2] for n, v in run.values.items()})
    assert prepare(short, alone()[0]) is None
    found = compared(alone(), short)
    assert "cannot judge" == found.verdict
    assert "Cannot judge: 0 settled points; at least 12 are needed." == found.headline
    assert "Record settled operation" in found.next
    assert found.fit is None
