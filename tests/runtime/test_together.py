"""Several recordings read as one: clocks, numbers, dates, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording
from rulec_runtime.recordings.together import (
    OWN_CLOCKS,
    names_of,
    part_of,
    read_recordings,
)

COLUMNS = ("A.n [rpm]", "A.dp [bar]", "A.T [degC]")
STEP = 2.0


def written(
    path: Path,
    speed: float,
    rows: int = 30,
    columns: tuple[str, ...] = COLUMNS,
    stamps: list[str] | None = None,
) -> Path:
    """A file with one speed throughout."""
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
    """In the order given; the clock of each begins anew, and the answer says so."""
    paths = [written(tmp_path / "b.csv", 900), written(tmp_path / "a.csv", 700, rows=20)]
    found = read_recordings(paths, abc)
    assert ("b.csv", "a.csv") == found.sources
    assert found.source is not None
    assert found.origin is not None
    assert [0] * 30 + [1] * 20 == found.source.tolist()
    assert [900] * 30 + [700] * 20 == speeds(found)
    assert np.all(np.diff(found.time) == STEP)
    own = found.time - found.origin
    assert [0.0, 58.0, 0.0, 38.0] == own[[0, 29, 30, 49]].tolist()
    assert 2 == len(np.unique(found.segment))
    assert OWN_CLOCKS in found.notes
    assert any("b.csv from 0 s, a.csv from 60 s" in note for note in found.notes)


def test_with_dates_they_stand_on_one_axis(tmp_path: Path, abc: Ruleset) -> None:
    """Whatever the order given; each keeps its number."""
    late = written(tmp_path / "late.csv", 900, stamps=stamps(9))
    early = written(tmp_path / "early.csv", 700, stamps=stamps(2))
    found = read_recordings([late, early], abc)
    assert ("late.csv", "early.csv") == found.sources
    assert found.source is not None
    assert [1] * 30 + [0] * 30 == found.source.tolist()
    assert [700] * 30 + [900] * 30 == speeds(found)
    assert 7 * 86400.0 == found.time[30] - found.time[0]
    assert found.origin is None
    assert found.calendar is not None
    assert "2024-03-02T12:00:00" == found.calendar.iso(0.0)
    assert OWN_CLOCKS not in found.notes
    zero = [note for note in found.notes if "time 0 s is" in note]
    assert ["time 0 s is 2024-03-02 12:00:00 (the recording names no zone)"] == zero


def test_zones_of_all_recordings_count(tmp_path: Path, abc: Ruleset) -> None:
    """Each at its own time; where one file names none, nobody knows which was first."""
    winter = [f"{stamp}+01:00" for stamp in stamps(2)]
    summer = [f"2024-06-02T12:{i:02d}:00+02:00" for i in range(30)]
    late = written(tmp_path / "late.csv", 900, stamps=summer)
    early = written(tmp_path / "early.csv", 700, stamps=winter)
    found = read_recordings([late, early], abc)
    assert found.calendar is not None
    assert "2024-03-02T12:00:00+01:00" == found.calendar.iso(0.0)
    assert "2024-06-02T12:00:00+02:00" == found.calendar.iso(float(found.time[30]))
    none = written(tmp_path / "none.csv", 900, stamps=stamps(9))
    with pytest.raises(RecordingRefused, match=r"early\.csv name a zone, those of none\.csv none"):
        read_recordings([early, none], abc)


def test_dates_of_some_are_not_used(tmp_path: Path, abc: Ruleset) -> None:
    """They count one behind the other, and the answer says so."""
    dated = written(tmp_path / "dated.csv", 900, stamps=stamps(9))
    plain = written(tmp_path / "plain.csv", 700)
    found = read_recordings([plain, dated], abc)
    assert found.calendar is None
    assert found.origin is not None
    assert "some recordings have dates, others none: the dates are not used" in found.notes


def test_a_part_is_what_was_read(tmp_path: Path, abc: Ruleset) -> None:
    """One of them alone is a recording like any other; two of three keep their order."""
    paths = [written(tmp_path / f"{n}.csv", 100 * n, rows=10 * n) for n in (7, 8, 9)]
    found = read_recordings(paths, abc)
    alone, single = part_of(found, {1}), read_recording(paths[1], abc)
    assert () == alone.sources
    assert alone.source is None
    assert alone.origin is not None
    assert single.time.tolist() == (alone.time - alone.origin).tolist()
    assert all(np.array_equal(alone.values[n], single.values[n]) for n in single.values)
    two = part_of(found, {0, 2})
    assert ("7.csv", "9.csv") == two.sources
    assert two.source is not None
    assert [0] * 70 + [1] * 90 == two.source.tolist()


def test_one_recording_stays_as_it_is(tmp_path: Path, abc: Ruleset) -> None:
    """No number, and its own clock."""
    found = read_recordings([written(tmp_path / "a.csv", 700)], abc)
    assert () == found.sources
    assert found.source is None
    assert found.origin is None


def test_files_called_alike_are_told_apart_by_their_folders() -> None:
    """Else nobody knows which of them is meant."""
    paths = [Path("/x/monday/run.csv"), Path("/x/tuesday/run.csv"), Path("/x/other.csv")]
    assert ("monday/run.csv", "tuesday/run.csv", "other.csv") == names_of(paths)


def test_what_would_count_twice_is_refused(tmp_path: Path, abc: Ruleset) -> None:
    """The same file, a copy of it, and two files of one time."""
    first = written(tmp_path / "first.csv", 700)
    copy = written(tmp_path / "copy.csv", 700)
    with pytest.raises(RecordingRefused, match=r"first\.csv: this is the same file, given twice"):
        read_recordings([first, first], abc)
    with pytest.raises(RecordingRefused, match=r"copy\.csv: this is a copy of .*first\.csv"):
        read_recordings([first, copy], abc)
    one = written(tmp_path / "one.csv", 700, stamps=stamps(2))
    other = written(tmp_path / "other.csv", 900, stamps=stamps(2))
    with pytest.raises(RecordingRefused, match="were recorded at the same time"):
        read_recordings([one, other], abc)


def test_recordings_that_do_not_suit_each_other_are_refused(tmp_path: Path, abc: Ruleset) -> None:
    """Columns that one lacks, other units: which file, which column, what to do."""
    first = written(tmp_path / "first.csv", 700)
    fewer = written(tmp_path / "fewer.csv", 900, columns=COLUMNS[:2])
    message = r"fewer\.csv has no column A\.T, and first\.csv has one"
    for paths in ([first, fewer], [fewer, first]):
        with pytest.raises(RecordingRefused, match=message):
            read_recordings(paths, abc)
    unit = written(tmp_path / "unit.csv", 900, columns=("A.n [rpm]", "A.dp [kPa]", "A.T [degC]"))
    with pytest.raises(RecordingRefused, match=r"unit\.csv: the column of A\.dp is in another"):
        read_recordings([first, unit], abc)
    foreign = tmp_path / "foreign.csv"
    foreign.write_text("time [s],X.y [bar]\n0,1\n1,2\n", encoding="utf-8")
    with pytest.raises(RecordingRefused, match="no column belongs to this plant"):
        read_recordings([first, foreign], abc)


def test_a_note_names_its_file_once(tmp_path: Path, abc: Ruleset) -> None:
    """Also one that begins with it."""
    paths = [written(tmp_path / "a.csv", 700), written(tmp_path / "b.csv", 900)]
    lines = paths[1].read_text(encoding="utf-8").splitlines()
    blank = [",".join((*line.split(",")[:-1], "")) for line in lines[1:]]
    paths[1].write_text("\n".join([lines[0], *blank]) + "\n", encoding="utf-8")
    notes = [note for note in read_recordings(paths, abc).notes if "A.T" in note]
    assert notes
    assert all(note.count("b.csv") == 1 for note in notes)
