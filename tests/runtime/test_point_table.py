"""Tables of operating points are told from recordings, in order or shuffled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.join_recordings import together
from rulec_runtime.recordings.point_table import each_row, is_point_table
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording
from rulec_runtime.recordings.stationary import Stretches

from rulec.prove.truth import abc as abc_rig
from rulec.prove.truth import calibration_run, record, write_csv
from tests.conftest import compiled
from tests.runtime.reports import EXAMPLES

HELD = 6
"""Rows for which a recording stays at a point, where a table has one."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Settled points of the independent truth, each held, with noise."""
    file: Path = tmp_path_factory.mktemp("points") / "run.csv"
    write_csv(file, record(calibration_run(abc_rig()), seed=3).readings)
    return read_recording(file, compiled("abc"))


def _rows(recording: Recording, rows: NDArray[np.intp]) -> Recording:
    """Some rows, in a new order, one second apart."""
    values = {name: readings[rows] for name, readings in recording.values.items()}
    segment = np.zeros(len(rows), dtype=int)
    return Recording(
        time=np.arange(len(rows), dtype=float), values=values, segment=segment, missing=(), notes=()
    )


def _points(recording: Recording) -> NDArray[np.intp]:
    """One row of each point: the middle between two changes of a set value."""
    speed = recording.values["A.n"]
    changes = np.flatnonzero(np.abs(np.diff(speed)) > 0.02 * np.ptp(speed)) + 1
    edges = np.concatenate([[0], changes, [len(speed)]])
    middles: NDArray[np.intp] = (edges[1:] + edges[:-1]) // 2
    return middles[np.diff(edges) > HELD]


def test_tables_are_told_from_runs(run: Recording, abc: Ruleset) -> None:
    """A table moves on at every row, in any order; what is held changes by its noise alone, and a
    single reading that jumps at every row is a bad sensor."""
    points, random = _points(run), np.random.default_rng(5)
    table = _rows(run, points)
    for one in (table, _rows(run, random.permutation(points))):
        assert is_point_table(one, abc)
    assert [1] * len(table) == each_row(table).lengths.tolist()
    a_few_rows_each = (points[:, None] + np.arange(3)).ravel()
    held = _rows(run, np.full(40, points[0]))
    noisy = held.values["A.dp"] * random.uniform(0.5, 1.5, 40)
    for other in (
        _rows(run, a_few_rows_each),
        _rows(run, np.arange(points[-1])),
        replace(held, values={**held.values, "A.dp": noisy}),
        *(read_recording(EXAMPLES / f"{n}.csv", abc) for n in ("calibration", "leakage_A")),
    ):
        assert not is_point_table(other, abc)


def test_beside_a_table_a_course_counts_by_its_states(run: Recording, abc: Ruleset) -> None:
    """A row per state in which it rests, with the means of the readings there, and a word on it."""
    table = _rows(run, _points(run))
    both = together([Path("table.csv"), Path("course.csv")], [table, run], abc)
    assert is_point_table(both, abc)
    assert both.source is not None
    states = both.values["A.n"][both.source == 1]
    visited = table.values["A.n"]
    assert len(states) == pytest.approx(len(visited), abs=2)
    away = np.abs(states[:, None] - visited).min(axis=1)
    assert away.max() < 0.01 * visited.mean()
    assert any("course.csv: its" in note and "table.csv" in note for note in both.notes)


def test_a_course_that_never_rests_is_refused_beside_a_table(
    run: Recording, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [Path("course.csv"), Path("table.csv")]
    monkeypatch.setattr(
        "rulec_runtime.recordings.join_recordings.find_stretches",
        lambda *_, **__: Stretches(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)),
    )
    with pytest.raises(RecordingRefused, match=r"course\.csv: it never settles, and table\.csv"):
        together(files, [run, _rows(run, _points(run))], abc)
