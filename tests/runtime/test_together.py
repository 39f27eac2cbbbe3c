"""Several recordings read as one: clocks, numbers, dates, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.join_recordings import OWN_CLOCKS, names_of, part_of, read_recordings
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording

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
    """In the order given; the clock of each begins anew, and the answer says so. A part of them is
    what was read."""
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
    alone, single = part_of(found, {1}), read_recording(paths[1], abc)
    assert ((), None) == (alone.sources, alone.source)
    assert alone.origin is not None
    assert single.time.tolist() == (alone.time - alone.origin).tolist()
    assert all(np.array_equal(alone.values[n], single.values[n]) for n in single.values)


def test_with_dates_they_stand_on_one_axis(tmp_path: Path, abc: Ruleset) -> None:
    """Whatever the order given; each keeps its number. Dates of some alone are not used."""
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
    found = read_recordings([written(tmp_path / "plain.csv", 700), late], abc)
    assert found.calendar is None
    assert found.origin is not None
    assert "some recordings have dates, others none: the dates are not used" in found.notes


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


def test_names_of_recordings(tmp_path: Path, abc: Ruleset) -> None:
    """Files called alike are told apart by their folders; one alone has no number and its own
    clock."""
    paths = [Path("/x/monday/run.csv"), Path("/x/tuesday/run.csv"), Path("/x/other.csv")]
    assert ("monday/run.csv", "tuesday/run.csv", "other.csv") == names_of(paths)
    found = read_recordings([written(tmp_path / "a.csv", 700)], abc)
    assert ((), None, None) == (found.sources, found.source, found.origin)


def test_what_does_not_suit_is_refused(tmp_path: Path, abc: Ruleset) -> None:
    """The same file, a copy of it, two files of one time; columns that one lacks, other units:
    which file, which column, what to do."""
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
    """Also one that begins with it."""
    paths = [written(tmp_path / "a.csv", 700), written(tmp_path / "b.csv", 900)]
    head, *lines = paths[1].read_text(encoding="utf-8").splitlines()
    blank = [line.rpartition(",")[0] + "," for line in lines]
    paths[1].write_text("\n".join([head, *blank]) + "\n", encoding="utf-8")
    notes = [note for note in read_recordings(paths, abc).notes if "A.T" in note]
    assert notes
    assert all(note.count("b.csv") == 1 for note in notes)
