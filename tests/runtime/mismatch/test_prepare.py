"""Step 0: settled points, what their blocks serve for, and recordings with holes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.limits import POINT_BUDGET
from rulec.mismatch.evidence.samples import ESTIMATION, HELDOUT, PATTERN, SELECTION
from rulec.mismatch.evidence.steady.prepare import Data, prepare
from tests.runtime.mismatch.made import HOLD, alone, compared, opened, recorded, tour

SAMPLES = 300


@pytest.fixture(scope="module")
def run() -> Recording:
    """A healthy recording."""
    rules, _ = alone()
    return recorded(alone(), tour(rules, SAMPLES))


def prepared(recording: Recording, *heldout: tuple[float, float]) -> Data:
    data = prepare(recording, alone()[0], heldout)
    assert data is not None
    return data


def test_points_are_split_by_blocks(run: Recording) -> None:
    """All points of a block serve for one thing, blocks follow each other, every fifth is shut."""
    data = prepared(run)
    assert np.all(np.diff(data.block) >= 0)
    parts = [set(data.part[data.block == b].tolist()) for b in np.unique(data.block)]
    assert [{PATTERN[b % len(PATTERN)]} for b in range(len(parts))] == parts
    sizes = np.bincount(data.block)
    assert sizes.max() - sizes.min() <= 1
    assert np.array_equal(data.open, data.part != HELDOUT)
    assert not data.of_rows


def test_the_words_count_what_is_there(run: Recording) -> None:
    """Numbers of points in the sentence are those of the split."""
    data = prepared(run)
    counts = [int((data.part == p).sum()) for p in (ESTIMATION, SELECTION, HELDOUT)]
    expected = "{} for estimation, {} for selection, {} held out (every fifth block)"
    assert expected.format(*counts) in data.split
    assert data.split.startswith(f"{len(data)} settled points in 25 blocks of time")


def test_asked_spans_are_held_out_and_nothing_else(run: Recording) -> None:
    """Points inside are shut, all others open, and no block has points of two kinds."""
    data = prepared(run, (60.0, 90.0), (200.0, 220.0))
    inside = ((data.time >= 60) & (data.time <= 90)) | ((data.time >= 200) & (data.time <= 220))
    assert np.array_equal(inside, data.part == HELDOUT)
    for block in np.unique(data.block):
        assert 1 == len(set(data.part[data.block == block].tolist()))
    assert {ESTIMATION, SELECTION, HELDOUT} == set(data.part.tolist())
    assert "held out (as asked)" in data.split


def test_the_hash_is_that_of_the_split(run: Recording) -> None:
    """The same recording gives the same hash; another split another one."""
    first, again, other = prepared(run), prepared(run), prepared(run, (60.0, 90.0))
    assert first.digest == again.digest
    assert 16 == len(first.digest)
    assert first.digest != other.digest


def test_points_lie_in_settled_stretches(run: Recording) -> None:
    """No point is an average over a change of the speed."""
    data = prepared(run)
    speed = data.values["A.n"]
    plateaus = tour(alone()[0], SAMPLES)["A.n"][::HOLD]
    nearest = np.abs(speed[:, None] - plateaus).min(axis=1)
    assert nearest.max() < 0.01 * speed.min()


def test_long_recordings_are_averaged() -> None:
    """Points times observers stay within the budget, and averages have less noise."""
    rules, _ = alone()
    held = {"A.n": np.repeat(tour(rules, 25 * HOLD)["A.n"][::HOLD], 800)}
    data = prepared(recorded(alone(), held))
    assert len(data) * len(rules.observers) <= 1.5 * POINT_BUDGET
    single = prepared(recorded(alone(), tour(rules, SAMPLES)))
    assert np.median(data.noise["A.dp"]) < 0.75 * np.median(single.noise["A.dp"])


def test_a_table_of_points_has_a_point_per_row(run: Recording) -> None:
    """One row per operating point; the noise is that of the sensors' classes."""
    rows = np.arange(HOLD // 2, SAMPLES, HOLD)
    values = {name: v[rows] for name, v in run.values.items()}
    n = len(rows)
    table = Recording(
        time=np.arange(n, dtype=float),
        values=values,
        segment=np.zeros(n, dtype=int),
        missing=(),
        notes=(),
    )
    data = prepared(table)
    assert data.of_rows
    assert n == len(data)
    for name, noise in data.noise.items():
        assert 0.3 * data.points.systematic[name] == pytest.approx(noise), name


def test_gaps_and_lost_readings_are_left_out(run: Recording) -> None:
    """A pause and a time without readings leave settled points on either side, none inside."""
    lost = (run.time >= 100) & (run.time < 130)
    values = {n: np.where(lost, np.nan, v) for n, v in run.values.items()}
    late = replace(run, time=np.where(run.time >= 200, run.time + 5000.0, run.time), values=values)
    data = prepared(late)
    usable = np.isfinite(data.values["A.dp"])
    assert not np.any((data.time[usable] > 101) & (data.time[usable] < 129))
    assert not np.any((data.time > 200) & (data.time < 5200))
    assert np.any(data.time > 5200)


def test_nothing_settled_cannot_be_judged(run: Recording) -> None:
    """Two samples are no stretch; the answer says what to record."""
    short = Recording(
        time=run.time[:2],
        values={n: v[:2] for n, v in run.values.items()},
        segment=run.segment[:2],
        missing=(),
        notes=(),
    )
    assert prepare(short, alone()[0]) is None
    found = compared(alone(), short)
    assert "cannot judge" == found.verdict
    assert "Cannot judge: 0 settled points; at least 12 are needed." == found.headline
    assert "Record settled operation" in found.next
    assert found.fit is None


def test_noise_is_that_of_the_sensors() -> None:
    """What was put on the readings is what is found, within a tenth."""
    rules, _ = opened("abc")
    recording = recorded(opened("abc"), tour(rules, 1200, hold=60))
    data = prepare(recording, rules)
    assert data is not None
    for name in ("A.dp", "A.P_el", "B.dp", "C.dp"):
        true = 0.3 * np.median(data.points.systematic[name])
        assert true == pytest.approx(float(np.median(data.noise[name])), rel=0.1), name
