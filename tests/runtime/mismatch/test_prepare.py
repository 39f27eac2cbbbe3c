"""Step 0: settled points, what their blocks serve for, recordings with holes; every row is counted
once, by what it served for, or why it did not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.mismatch.evidence.limits import POINT_BUDGET
from rulec.mismatch.evidence.model import ESTIMATION, HELDOUT, PATTERN, SELECTION
from rulec.mismatch.evidence.steady.model import TOO_MANY, UNSETTLED, evidence_of
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.result import Evidence
from tests.runtime.mismatch.made import (
    HOLD,
    alone,
    changed,
    compared,
    prepared,
    recorded,
    rows_at,
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


def counted(recording: Recording) -> tuple[Evidence, ...]:
    rows = rows_at(alone(), recording)
    return evidence_of(recording, rows.system.data, rows)


def rows(told: tuple[Evidence, ...], because: str) -> int:
    return sum(e.rows for e in told if because in e.because)


def test_every_row_is_counted_once() -> None:
    """Settled, held out and unsettled rows sum to the recording, as do those of a pump that stands,
    which vanished in silence, and those spared: of many short stretches every so-manyth is taken.
    All are unsettled where there is no point."""
    rules, _ = alone()
    recording = recorded(alone(), tour(rules, SAMPLES))
    told = counted(recording)
    assert SAMPLES == sum(e.rows for e in told)
    assert rows(told, UNSETTLED) > 0
    assert all(e.used != (e.because == UNSETTLED) for e in told)
    least = rules.signal_by_id["A.n"].minimum
    assert least is not None
    slow = recording.values["A.n"].copy()
    slow[100:150] = 0.5 * least
    told = counted(changed(recording, {"A.n": slow}))
    assert SAMPLES == sum(e.rows for e in told)
    assert rows(told, "A.n is below") >= 40
    assert not any(e.used for e in told if "A.n is below" in e.because)
    data = prepared(rules, recording)
    spared = replace(data, sample=np.where(data.sample > 3, -2, data.sample))
    told = evidence_of(recording, spared)
    assert rows(told, TOO_MANY) == int((spared.sample == -2).sum()) > 0
    assert (Evidence(SAMPLES, False, UNSETTLED),) == evidence_of(recording, None)


def test_rows_that_cannot_be_read_are_counted(tmp_path: Path) -> None:
    """Rows without time, with a time that was there, or too few cells are rows of the file."""
    rules, _ = alone()
    names = [s for s in rules.signals if s.id in rules.read]
    head = ",".join(["time [s]", *(f"{s.id} [{s.unit}]" for s in names)])
    cells = ",".join("1" for _ in names)
    times = ["0", "1", "1", "", *(str(i) for i in range(2, 20))]
    lines = [head, *(f"{t},{cells}" for t in times), "20"]
    file = tmp_path / "some.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    told = evidence_of(read_recording(file, rules), None)
    assert len(lines) - 1 == sum(e.rows for e in told)
    assert 1 == rows(told, "no usable time") == rows(told, "repeat the time")
