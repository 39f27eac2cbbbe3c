"""Several recordings read as one; tables of operating points, told from recordings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.join_recordings import (
    OWN_CLOCKS,
    names_of,
    part_of,
    read_recordings,
    together,
)
from rulec_runtime.recordings.point_table import each_row, is_point_table
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording
from rulec_runtime.recordings.stationary import Stretches

from tests.conftest import compiled
from tests.dosing import RIGS, calibration_run, record, write_csv
from tests.runtime.reports import EXAMPLES
from tests.runtime.sheets import sampled

COLUMNS = ("A.n [rpm]", "A.dp [bar]", "A.T [degC]")
STEP = 2.0


def written(
    path: Path,
    speed: float,
    rows: int = 30,
    columns: tuple[str, ...] = COLUMNS,
    stamps: list[str] | None = None,
) -> Path:
    numbers = {"A.n [rpm]": speed, "A.dp [bar]": 1.5, "A.dp [kPa]": 150.0, "A.T [degC]": 20.0}
    head = "time" if stamps else "time [s]"
    lines = [",".join((head, *columns))]
    for i in range(rows):
        time = stamps[i] if stamps else f"{STEP * i:g}"
        lines.append(",".join((time, *(f"{numbers[c]:g}" for c in columns))))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def stamps(day: int, rows: int = 30) -> list[str]:
    return [f"2024-03-{day:02d}T12:{i:02d}:00" for i in range(rows)]


def speeds(recording: Recording) -> list[int]:
    return np.round(recording.values["A.n"] * 60).astype(int).tolist()


def test_without_dates_they_stand_one_behind_the_other(tmp_path: Path, abc: Ruleset) -> None:
    paths = [written(tmp_path / "b.csv", 900), written(tmp_path / "a.csv", 700, rows=20)]
    found = read_recordings(paths, abc)
    assert ("b.csv", "a.csv") == found.sources
    assert [0] * 30 + [1] * 20 == found.source.tolist()
    assert [900] * 30 + [700] * 20 == speeds(found)
    assert np.all(np.diff(found.time) == STEP)
    own = found.time - found.origin
    assert [0.0, 58.0, 0.0, 38.0] == own[[0, 29, 30, 49]].tolist()
    assert 2 == len(np.unique(found.segment))
    assert OWN_CLOCKS in found.notes
    assert any("b.csv from 0 s, a.csv from 60 s" in note for note in found.notes)
    alone, single = part_of(found, {1}), read_recording(paths[1], abc)
    assert ((), None) == (alone.sources, alone.source)
    assert single.time.tolist() == (alone.time - alone.origin).tolist()
    assert all(np.array_equal(alone.values[n], single.values[n]) for n in single.values)


def test_with_dates_they_stand_on_one_axis(tmp_path: Path, abc: Ruleset) -> None:
    late = written(tmp_path / "late.csv", 900, stamps=stamps(9))
    early = written(tmp_path / "early.csv", 700, stamps=stamps(2))
    found = read_recordings([late, early], abc)
    assert ("late.csv", "early.csv") == found.sources
    assert [1] * 30 + [0] * 30 == found.source.tolist()
    assert [700] * 30 + [900] * 30 == speeds(found)
    assert 7 * 86400.0 == found.time[30] - found.time[0]
    assert found.origin is None
    assert "2024-03-02T12:00:00" == found.calendar.iso(0.0)
    assert OWN_CLOCKS not in found.notes
    zero = [note for note in found.notes if "time 0 s is" in note]
    assert ["time 0 s is 2024-03-02 12:00:00 (the recording names no zone)"] == zero
    found = read_recordings([written(tmp_path / "plain.csv", 700), late], abc)
    assert found.calendar is None
    assert found.origin is not None
    assert "some recordings have dates, others none: the dates are not used" in found.notes


def test_zones_of_all_recordings_count(tmp_path: Path, abc: Ruleset) -> None:
    winter = [f"{stamp}+01:00" for stamp in stamps(2)]
    summer = [f"2024-06-02T12:{i:02d}:00+02:00" for i in range(30)]
    late = written(tmp_path / "late.csv", 900, stamps=summer)
    early = written(tmp_path / "early.csv", 700, stamps=winter)
    found = read_recordings([late, early], abc)
    assert "2024-03-02T12:00:00+01:00" == found.calendar.iso(0.0)
    assert "2024-06-02T12:00:00+02:00" == found.calendar.iso(float(found.time[30]))
    none = written(tmp_path / "none.csv", 900, stamps=stamps(9))
    with pytest.raises(RecordingRefused, match=r"early\.csv name a zone, those of none\.csv none"):
        read_recordings([early, none], abc)


def test_names_of_recordings(tmp_path: Path, abc: Ruleset) -> None:
    paths = [Path("/x/monday/run.csv"), Path("/x/tuesday/run.csv"), Path("/x/other.csv")]
    assert ("monday/run.csv", "tuesday/run.csv", "other.csv") == names_of(paths)
    found = read_recordings([written(tmp_path / "a.csv", 700)], abc)
    assert ((), None, None) == (found.sources, found.source, found.origin)


def test_what_does_not_suit_is_refused(tmp_path: Path, abc: Ruleset) -> None:
    first = written(tmp_path / "first.csv", 700)
    copy = written(tmp_path / "copy.csv", 700)
    one = written(tmp_path / "one.csv", 700, stamps=stamps(2))
    other = written(tmp_path / "other.csv", 900, stamps=stamps(2))
    fewer = written(tmp_path / "fewer.csv", 900, columns=COLUMNS[:2])
    unit = written(tmp_path / "unit.csv", 900, columns=("A.n [rpm]", "A.dp [kPa]", "A.T [degC]"))
    foreign = tmp_path / "foreign.csv"
    foreign.write_text("time [s],X.y [bar]\n0,1\n1,2\n", encoding="utf-8")
    fewer_columns = r"fewer\.csv has no column A\.T, and first\.csv has one"
    for paths, message in (
        ([first, first], r"first\.csv: this is the same file, given twice"),
        ([first, copy], r"copy\.csv: this is a copy of .*first\.csv"),
        ([one, other], "were recorded at the same time"),
        ([first, fewer], fewer_columns),
        ([fewer, first], fewer_columns),
        ([first, unit], r"unit\.csv: the column of A\.dp is in another"),
        ([first, foreign], "no column belongs to this plant"),
    ):
        with pytest.raises(RecordingRefused, match=message):
            read_recordings(paths, abc)


def test_a_note_names_its_file_once(tmp_path: Path, abc: Ruleset) -> None:
    paths = [written(tmp_path / "a.csv", 700), written(tmp_path / "b.csv", 900)]
    head, *lines = paths[1].read_text(encoding="utf-8").splitlines()
    blank = [line.rpartition(",")[0] + "," for line in lines]
    paths[1].write_text("\n".join([head, *blank]) + "\n", encoding="utf-8")
    notes = [note for note in read_recordings(paths, abc).notes if "A.T" in note]
    assert notes
    assert all(note.count("b.csv") == 1 for note in notes)


HELD = 6
"""Rows for which a recording stays at a point, where a table has one."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Settled points of the independent truth, each held, with noise."""
    file: Path = tmp_path_factory.mktemp("points") / "run.csv"
    write_csv(file, record(calibration_run(RIGS["abc"]), seed=3).readings)
    return read_recording(file, compiled("abc"))


def _rows(recording: Recording, rows: NDArray[np.intp]) -> Recording:
    """Some rows, in a new order, one second apart."""
    return sampled({name: readings[rows] for name, readings in recording.values.items()})


def _points(recording: Recording) -> NDArray[np.intp]:
    """One row of each point: the middle between two changes of a set value."""
    speed = recording.values["A.n"]
    changes = np.flatnonzero(np.abs(np.diff(speed)) > 0.02 * np.ptp(speed)) + 1
    edges = np.concatenate([[0], changes, [len(speed)]])
    middles: NDArray[np.intp] = (edges[1:] + edges[:-1]) // 2
    return middles[np.diff(edges) > HELD]


def test_tables_are_told_from_runs(run: Recording, abc: Ruleset) -> None:
    """A single reading that jumps at every row is a bad sensor."""
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
