"""Recordings read as one, and in pieces; tables of operating points, told from recordings."""

import gzip
import json
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady import limits as of_steady
from rulec_runtime.recordings import limits as of_recordings
from rulec_runtime.recordings import text_table
from rulec_runtime.recordings.join_recordings import (
    OWN_CLOCKS,
    names_of,
    part_of,
    read_recordings,
    together,
)
from rulec_runtime.recordings.larger_than_memory import array
from rulec_runtime.recordings.point_table import each_row, is_point_table
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording
from rulec_runtime.recordings.stationary import Stretches
from rulec_runtime.report.json_form import diagnosis_form

from tests.conftest import ROOT, compiled
from tests.dosing import RIGS, calibration_run, record, write_csv
from tests.runtime.reports import EXAMPLES
from tests.runtime.sheets import sampled, write

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


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Makes pieces small, and puts all arrays into files."""

    def set_to() -> None:
        monkeypatch.setattr(of_recordings, "IN_MEMORY", 0)
        monkeypatch.setattr(of_steady, "POINTS_AT_ONCE", 2)
        monkeypatch.setattr(text_table, "BATCH", 7)

    return set_to


def odd(recording: Recording) -> Recording:
    """With gaps, a pause, a reading that sticks and one that dies."""
    n = len(recording)
    values = {name: column.copy() for name, column in recording.values.items()}
    first, second, *_ = (v for v in values.values() if np.isfinite(v).all())
    first[n // 5 : n // 5 + 2] = np.nan
    first[n // 2 : n // 2 + 9] = np.nan
    second[-n // 3 :] = second[-n // 3]
    time = recording.time + np.where(np.arange(n) > n // 4, 500.0, 0.0)
    return replace(recording, values=values, time=time)


def again(recording: Recording) -> Recording:
    """The same three times, one behind the other."""
    values = {name: np.tile(column, 3) for name, column in recording.values.items()}
    return sampled(values, missing=recording.missing)


def close(number: str) -> object:
    """Products of matrices with other numbers of columns may differ in their last digits."""
    return pytest.approx(float(number), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("plant", "name", "changed"),
    [
        ("abc", "leakage_A.csv", again),
        ("abc", "leakage_A.parquet", copy),
        ("abc", "swapped.csv", copy),
        ("abc", "step_B.csv", odd),
        ("mixing-rig", "clogging_D.csv", odd),
    ],
)
def test_same_findings(
    plant: str,
    name: str,
    changed: Callable[[Recording], Recording],
    tiny: Callable[[], None],
) -> None:
    rules, file = compiled(plant), ROOT / "plants" / plant / "examples" / name
    whole = json.dumps(diagnosis_form(diagnose(changed(read_recording(file, rules)), rules)))
    tiny()
    pieces = json.dumps(diagnosis_form(diagnose(changed(read_recording(file, rules)), rules)))
    assert json.loads(whole, parse_float=close) == json.loads(pieces)


def cells(row: Callable[[int], str], first: int = 0, header: str = "time [s],A.dp [bar]") -> str:
    return "\n".join([header, *map(row, range(first, 40))]) + "\n"


CELLS = {
    "dates": cells(lambda k: f"2026-01-01 00:{k:02d}:00,{k}", 0, "time,A.dp [bar]"),
    "comma": cells(lambda k: f"{k},5;{k},25", 0, "time [s];A.dp [bar]"),
    "late number": cells(lambda k: f"{k},{k}" if k > 8 else "x7,1.5", 0, "time,A.dp [bar]"),
    "words": cells(lambda k: f"{k},{'Bad' if k in (30, 31) else k}"),
    "disorder": cells(lambda k: f"{(7 * k) % 40},{k}"),
    "twice": cells(lambda k: f"{k // 2},{k}"),
    "no time": cells(lambda k: f"{k if k % 3 else ''},{k}"),
    "zones": cells(lambda k: f"2026-01-01T00:{k}:00+0{k // 20}:00,{k}", 20, "time,A.dp [bar]"),
    "ragged": cells(lambda k: f"{k},{k}{',' * (k % 5 if k > 20 else 0)}1"),
}


@pytest.mark.parametrize("name", CELLS)
def test_same_recording(name: str, tmp_path: Path, tiny: Callable[[], None]) -> None:
    rules = compiled("abc")
    file = write(tmp_path, gzip.compress(CELLS[name].encode()), "made.csv.gz")
    whole = read_recording(file, rules)
    tiny()
    pieces = read_recording(file, rules)
    np.testing.assert_array_equal(whole.time, pieces.time)
    np.testing.assert_array_equal(whole.values["A.dp"], pieces.values["A.dp"])
    assert (whole.notes, whole.clock) == (pieces.notes, pieces.clock)
    assert (whole.calendar, whole.left_out) == (pieces.calendar, pieces.left_out)


def test_full_disk_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(of_recordings, "IN_MEMORY", 0)
    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    with pytest.raises(Exception, match="TMPDIR"):
        array(10)
