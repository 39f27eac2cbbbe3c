"""The reader of recordings: whatever a logger writes, the same numbers or a clear message."""

from __future__ import annotations

import dataclasses
import gzip
import re
import time
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import ColumnMap, Ruleset
from rulec_runtime.recordings import text_table
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording
from rulec_runtime.recordings.stationary import find_stretches, noise_of

from tests.conftest import ROOT
from tests.runtime.sheets import Sheet, example, write

SHEET = example()


def read(content: str | bytes, folder: Path, ruleset: Ruleset, name: str = "x.csv") -> Recording:
    return read_recording(write(folder, content, name), ruleset)


@pytest.fixture
def expected(abc: Ruleset) -> Recording:
    """The example as shipped."""
    return read_recording(ROOT / "plants" / "abc" / "examples" / "healthy.csv", abc)


def same(expected: Recording, found: Recording) -> None:
    np.testing.assert_allclose(found.time, expected.time, rtol=0, atol=1e-6)
    assert set(expected.values) == set(found.values)
    for name, values in expected.values.items():
        np.testing.assert_allclose(found.values[name], values, rtol=1e-12, err_msg=name)


UNITS = {
    "mbar": SHEET.scaled("A.dp", 1e3, "A.dp [mbar]"),
    "Pa": SHEET.scaled("A.dp", 1e5, "A.dp [Pa]"),
    "kPa": SHEET.scaled("A.dp", 1e2, "A.dp [kPa]"),
    "psi": SHEET.scaled("A.dp", 1e5 / 6894.757293168361, "A.dp [psi]"),
    "m3/h": SHEET.scaled("A.Q", 1e-3, "A.Q [m3/h]"),
    "raised m³/h": SHEET.scaled("A.Q", 1e-3, "A.Q [m³/h]"),
    "l/min": SHEET.scaled("A.Q", 1 / 60, "A.Q [l/min]"),
    "m^3/s": SHEET.scaled("A.Q", 1e-3 / 3600, "A.Q [m^3/s]"),
    "kW": SHEET.scaled("A.P_el", 1e-3, "A.P_el [kW]"),
    "1/min": SHEET.scaled("A.n", 1.0, "A.n [1/min]"),
    "min-1": SHEET.scaled("A.n", 1.0, "A.n [min-1]"),
    "min^-1": SHEET.scaled("A.n", 1.0, "A.n [min^-1]"),
    "Hz": SHEET.scaled("A.n", 1 / 60, "A.n [Hz]"),
    "degree sign": SHEET.renamed("A.T", "A.T [°C]"),
    "kelvin": SHEET.mapped("A.T", lambda _, c: repr(float(c) + 273.15)).renamed("A.T", "A.T [K]"),
    "cm": SHEET.scaled("A.l", 0.1, "A.l [cm]"),
    "spaces": SHEET.renamed("A.dp", " A.dp  [ bar ] "),
    "time in min": SHEET.scaled("time", 1 / 60, "time [min]"),
    "time in ms": SHEET.scaled("time", 1e3, "Time [ms]"),
    "time without unit": SHEET.renamed("time", "t"),
}


@pytest.mark.parametrize("name", UNITS)
def test_unit_of_the_header_changes_nothing(
    name: str, tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    """Any unit of the right quantity gives the same readings in SI, without a remark."""
    found = read(UNITS[name].text(), tmp_path, abc)
    same(expected, found)
    assert () == found.notes


FORMS = {
    "semicolon and decimal comma": SHEET.german(),
    "tab": SHEET.text("\t"),
    "tab and decimal comma": SHEET.german().replace(";", "\t"),
    "byte order mark": b"\xef\xbb\xbf" + SHEET.text().encode(),
    "utf-16": SHEET.text().encode("utf-16"),
    "latin-1": SHEET.renamed("A.T", "A.T [°C]").text().encode("latin-1"),
    "CRLF": SHEET.text(newline="\r\n"),
    "CR": SHEET.text(newline="\r"),
    "gz": gzip.compress(SHEET.text().encode()),
    "quoted header": re.sub(r"([^,\n]+)", r'"\1"', SHEET.text(), count=14),
    "all quoted": re.sub(r"([^,\n]+)", r'"\1"', SHEET.text()),
    "blank lines": "\n\n" + SHEET.text().replace("\n", "\n\n"),
    "comment above": "# Prüfstand 3\n# exported\n" + SHEET.text(),
    "separator named": "sep=;\n" + SHEET.german(),
    "trailing separator": SHEET.text().replace("\n", ",\n"),
    "trailing separators below the header": ",".join(SHEET.header)
    + SHEET.text().removeprefix(",".join(SHEET.header)).replace("\n", ",,\n")[2:],
    "no newline at the end": SHEET.text().rstrip("\n"),
    "row of blanks": SHEET.text() + "," * 13 + "\n",
    "numbers with exponent": SHEET.mapped("A.P_el", lambda _, c: f"{float(c):.10e}").text(),
    "spaces in cells": SHEET.text().replace(",", " , "),
}


@pytest.mark.parametrize("name", FORMS)
def test_form_of_the_file_changes_nothing(
    name: str, tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    """Separators, decimal signs, encodings and line ends: same readings, without a remark."""
    found = read(FORMS[name], tmp_path, abc)
    same(expected, found)
    assert () == found.notes


DATES = {
    "ISO": lambda k: f"2025-03-30T01:59:{k:02d}",
    "with a blank": lambda k: f"2025-03-30 01:59:{k:02d}.000",
    "with a zone": lambda k: f"2025-03-30T01:59:{k:02d}+02:00",
    "Zulu": lambda k: f"2025-03-30T01:59:{k:02d}Z",
    "day first": lambda k: f"30.03.2025 01:59:{k:02d}",
    "decimal comma": lambda k: f"30.3.2025 01:59:{k:02d},000",
}


@pytest.mark.parametrize("name", DATES)
def test_dates_count_from_the_first(
    name: str, tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    """Dates become seconds; a note says when 0 s was."""
    sheet = SHEET.mapped("time", lambda k, _: DATES[name](k)).renamed("time", "Zeit")
    found = read(sheet.text(";"), tmp_path, abc)
    same(expected, found)
    (note,) = found.notes
    assert note.startswith("time 0 s is 2025-03-")


def test_no_hour_is_lost_when_clocks_change(
    tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A date without zone is taken as written, whatever the zone of the computer."""
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    try:
        rows = [f"2025-03-30 0{1 + k // 30}:{2 * (k % 30):02d}" for k in range(60)]
        sheet = SHEET.mapped("time", lambda k, _: rows[k])
        assert {120.0} == set(np.diff(read(sheet.text(), tmp_path, abc).time))
    finally:
        monkeypatch.undo()
        time.tzset()


REFUSED = {
    "unknown unit": (SHEET.renamed("A.dp", "A.dp [barr]").text(), "did you mean 'bar'"),
    "gauge pressure": (SHEET.renamed("A.dp", "A.dp [bar(g)]").text(), "unknown unit 'bar(g)'"),
    "hostile unit": (SHEET.renamed("A.dp", "A.dp [__import__('os')]").text(), "unknown unit"),
    "huge power": (SHEET.renamed("A.dp", "A.dp [bar**9**9**9]").text(), "unknown unit"),
    "unit of another quantity": (
        SHEET.renamed("A.dp", "A.dp [W]").text(),
        "'A.dp [W]' is in W, but A.dp is measured in bar; are two columns swapped?",
    ),
    "two swapped columns": (
        SHEET.renamed("A.dp", "A.x")
        .renamed("A.P_el", "A.dp [W]")
        .renamed("A.x", "A.P_el [bar]")
        .text(),
        "are two columns swapped?",
    ),
    "same column twice": (
        SHEET.renamed("A.Q", "A.dp [bar]").text(),
        "two columns hold A.dp: 'A.dp [bar]' and 'A.dp [bar]'",
    ),
    "same signal in two units": (
        SHEET.renamed("A.Q", "A.dp [Pa]").text(),
        "two columns hold A.dp: 'A.dp [bar]' and 'A.dp [Pa]'; take one of them out",
    ),
    "empty": ("", "the file is empty"),
    "blank": ("\n \n\n", "the file is empty"),
    "header only": (SHEET.text().split("\n")[0], "a header but no rows"),
    "binary": (bytes(range(256)) * 20, "binary file; export the recording as CSV"),
    "spreadsheet": (b"PK\x03\x04\x14\x00\x06\x00" + bytes(100), "cannot be read as Excel file"),
    "old spreadsheet": (b"\xd0\xcf\x11\xe0" + bytes(100), "an old Excel; save it as .xlsx"),
    "pickle": (b"\x80\x04cposix\nsystem\n.", "a pickle of Python, which may run anything"),
    "damaged gz": (gzip.compress(SHEET.text().encode())[:500], "cannot be read"),
    "damaged inside gz": (
        (lambda z: z[:200] + bytes(50) + z[250:])(gzip.compress(SHEET.text().encode())),
        "cannot be read",
    ),
    "no time": (SHEET.renamed("time", "sample").text(), "no time column; expected 'time [s]'"),
    "time in words": (SHEET.filled("time", "früh").text(), "holds 'früh'; expected seconds"),
    "dates of two readings": (
        SHEET.filled("time", "3/4/2025 1:05").text(),
        "may be 3 April 2025 (day first) or 4 March 2025 (month first); say which in the column",
    ),
    "time in bar": (SHEET.renamed("time", "time [bar]").text(), "is in 'bar'; expected s, ms, min"),
    "all times empty": (SHEET.filled("time", "").text(), "time"),
    "two lines of words": (
        dataclasses.replace(SHEET, rows=(("s", *["rpm"] * 13),) * 2 + SHEET.rows).text(),
        "line below the header holds words",
    ),
    "line of words": (
        Sheet(
            tuple(title.partition(" [")[0] for title in SHEET.header),
            (("s", *["furlong"] * 13), *SHEET.rows),
        ).text(),
        "unknown unit 'furlong'",
    ),
    "decimal commas between commas": (
        SHEET.german().replace(";", ","),
        "is the decimal sign also the separator?",
    ),
    "both decimal signs": (
        SHEET.mapped("A.dp", lambda k, c: c.replace(".", ",") if k % 2 else c).text(";"),
        "'A.dp [bar]' mixes decimal comma and decimal point",
    ),
    "another plant": (
        "time [s],PS1 [bar],EPS1 [W]\n0,160,2400\n1,160,2400\n",
        "no column belongs to this plant. Expected columns such as 'A.n [rpm]'",
    ),
    "prose": ("Dear colleague,\nhere is the file.\n", "no time column"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_a_recording_is_refused(name: str, tmp_path: Path, abc: Ruleset) -> None:
    """The message begins with the file and says what is wrong, and mostly what to do."""
    content, message = REFUSED[name]
    with pytest.raises(RecordingRefused) as caught:
        read(content, tmp_path, abc)
    assert str(caught.value).startswith(str(tmp_path / "x.csv"))
    assert message in str(caught.value)


NOTED = {
    "no unit": (SHEET.renamed("A.dp", "A.dp"), "1 column names no unit; assumed is bar for 'A.dp'"),
    "German word": (
        SHEET.filled("A.dp", "Störung", 7, 9),
        "2 cells of A.dp are words (the first, in data row 8: 'Störung')",
    ),
    "Bad": (SHEET.filled("A.dp", "Bad", 3, 4), "1 cell of A.dp is a word"),
    "fill value": (
        SHEET.filled("A.dp", "9.96921e36", 5, 7),
        "2 cells of A.dp are beyond any sensor (the first in data row 6)",
    ),
    "infinity": (SHEET.filled("A.P_el", "inf", 5, 7), "2 cells of A.P_el are beyond any sensor"),
    "empty column": (SHEET.filled("A.dp", ""), "A.dp has not one reading"),
    "repeated times": (
        SHEET.mapped("time", lambda k, _: str(k // 2)),
        "30 rows repeat the time of another row",
    ),
    "a bad time": (SHEET.filled("time", "Bad", 4, 6), "2 rows have no usable time"),
    "endless time": (SHEET.filled("time", "inf", 4, 6), "2 rows have no usable time"),
    "unsorted": (
        Sheet(SHEET.header, SHEET.rows[::-1]),
        "the rows were not in order of time; they are now",
    ),
    "other signals": (
        SHEET.renamed("A.Q", "A.flow [l/h]"),
        "'A.flow [l/h]' is no signal of this plant's module A; is this a recording of another",
    ),
    "misspelt": (
        SHEET.renamed("A.dp", "A_dp [bar]"),
        "columns that belong to no signal of this plant: 'A_dp [bar]'",
    ),
}


@pytest.mark.parametrize("name", NOTED)
def test_what_can_be_read_in_part_is_noted(name: str, tmp_path: Path, abc: Ruleset) -> None:
    """The rest is read; a note with file name and place says what was not."""
    sheet, message = NOTED[name]
    found = read(sheet.text(), tmp_path, abc)
    assert any(message in note for note in found.notes), found.notes
    assert np.all(np.diff(found.time) > 0)
    assert all(not np.isinf(values).any() for values in found.values.values())


@pytest.mark.parametrize("word", ["", "NA", "n/a", "NaN", "null", "None", "-"])
def test_blank_words_need_no_remark(word: str, tmp_path: Path, abc: Ruleset) -> None:
    """What historians write for "no value" is no surprise."""
    found = read(SHEET.filled("A.dp", word, 5, 9).text(), tmp_path, abc)
    assert () == found.notes
    assert [5, 6, 7, 8] == np.flatnonzero(np.isnan(found.values["A.dp"])).tolist()


def test_ragged_rows_are_left_out(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """A row that is cut off, or has a cell too many, may hold anything anywhere."""
    lines = SHEET.text().splitlines()
    lines[5] = lines[5][:60]
    lines[9] = lines[9].replace(",", ",1,", 1)
    found = read("\n".join(lines), tmp_path, abc)
    assert len(expected) - 2 == len(found)
    assert not {4.0, 8.0} & set(found.time)
    assert "2 rows have another number of cells" in found.notes[0]
    assert "data row 5" in found.notes[0]


def test_missing_columns_are_named(tmp_path: Path, abc: Ruleset) -> None:
    """Those that an observer reads, in the order of the plant."""
    found = read(SHEET.without("A.dp", "B.P_el", "A.T").text(), tmp_path, abc)
    assert ("A.dp", "B.P_el") == found.missing


def test_a_temperature_is_no_time(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """A column T that stands before that of times is a temperature, by its symbol."""
    times, *others = SHEET.renamed("time", "t").text().splitlines()
    rows = [f"T [°C],{times}", *(f"21.5,{row}" for row in others)]
    same(expected, read("\n".join(rows) + "\n", tmp_path, abc))


def test_foreign_column_map(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """Foreign names with the units of the map; native names go on being read."""
    columns = (
        ColumnMap("A.dp", "PT 101 Ist", 100.0, 0.0),
        ColumnMap("A.T", "TT-101", 1.0, 273.15),
        ColumnMap("A.n", "SE_1 [U/min]", 1 / 60, 0.0),
    )
    foreign = dataclasses.replace(abc, columns=columns, time_column="Zeitstempel")
    sheet = SHEET.scaled("A.dp", 1e3, "PT 101 Ist").renamed("A.T", "TT-101")
    sheet = sheet.renamed("A.n", "SE_1 [U/min]").renamed("time", "Zeitstempel")
    found = read(sheet.german(), tmp_path, foreign)
    same(expected, found)
    twice = sheet.renamed("A.Q", "A.dp [bar]")
    with pytest.raises(RecordingRefused, match=r"two columns hold A\.dp: 'PT 101 Ist' and"):
        read(twice.text(), tmp_path, foreign)


def test_one_column_for_several_signals(tmp_path: Path, abc: Ruleset) -> None:
    """A sensor that several modules read stands once in the file, each signal in its own unit."""
    columns = (ColumnMap("A.T", "TT-1", 1.0, 273.15), ColumnMap("B.T", "TT-1", 1.0, 273.15))
    shared = dataclasses.replace(abc, columns=columns)
    sheet = SHEET.without("B.T").renamed("A.T", "TT-1")
    found = read(sheet.text(), tmp_path, shared)
    assert found.values["A.T"].tolist() == found.values["B.T"].tolist()
    assert "B.T" not in found.missing


def test_folder_in_order_of_time(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """Files whose times follow one another are joined by time, not by name."""
    first, second = Sheet(SHEET.header, SHEET.rows[:25]), Sheet(SHEET.header, SHEET.rows[25:])
    write(tmp_path, second.german(), "run1.CSV")
    write(tmp_path, gzip.compress(first.text().encode()), "run10.csv.gz")
    write(tmp_path, "not a recording", "notes.txt")
    found = read_recording(tmp_path, abc)
    same(expected, found)
    assert [25, 35] == np.bincount(found.segment).tolist()
    assert () == found.notes


def test_folder_with_times_that_start_anew(tmp_path: Path, abc: Ruleset) -> None:
    """Otherwise they stand one behind the other by name, and a note says where each begins."""
    for name in ("b.csv", "a.csv", "c.csv"):
        write(tmp_path, SHEET.text(), name)
    found = read_recording(tmp_path, abc)
    np.testing.assert_array_equal(np.arange(180.0), found.time)
    assert "a.csv from 0 s, b.csv from 60 s, c.csv from 120 s" in found.notes[0]


def test_folder_with_different_columns(tmp_path: Path, abc: Ruleset) -> None:
    """What one file lacks is no reading there."""
    write(tmp_path, SHEET.text(), "a.csv")
    later = SHEET.mapped("time", lambda k, _: str(100 + k)).without("A.dp")
    write(tmp_path, later.text(), "b.csv")
    found = read_recording(tmp_path, abc)
    readable = np.isfinite(found.values["A.dp"])
    assert [True] * 60 + [False] * 60 == readable.tolist()
    assert () == found.missing


def test_folder_of_dates_and_seconds_is_refused(tmp_path: Path, abc: Ruleset) -> None:
    write(tmp_path, SHEET.text(), "a.csv")
    dated = SHEET.mapped("time", lambda k, _: DATES["ISO"](k))
    write(tmp_path, dated.text(), "b.csv")
    with pytest.raises(RecordingRefused, match="some files of this folder have dates"):
        read_recording(tmp_path, abc)


@pytest.mark.parametrize("name", ["nothing.csv", "."])
def test_no_file(name: str, tmp_path: Path, abc: Ruleset) -> None:
    with pytest.raises(RecordingRefused, match=r"there is no such file|holds no \.csv"):
        read_recording(tmp_path / name, abc)


def test_batches_leave_no_trace(
    tmp_path: Path, abc: Ruleset, expected: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows are read in batches; where one ends shows nowhere, also not in words and row numbers."""
    monkeypatch.setattr(text_table, "BATCH", 7)
    same(expected, read(SHEET.text(), tmp_path, abc))
    found = read(SHEET.filled("A.dp", "Bad", 30, 32).text(), tmp_path, abc)
    assert "2 cells of A.dp are words (the first, in data row 31: 'Bad')" in found.notes[0]


COMPOUND = {
    "bar/(l/h)": 1e5 * 3.6e6,
    "bar/(l/h)**2": 1e5 * 3.6e6**2,
    "l/(min*bar)": 1e-3 / 6e6,
    "W*s": 1.0,
    "mm/s^2": 1e-3,
    "%": 0.01,
    "1": 1.0,
    **dict.fromkeys(
        [
            "bar(g)",
            "furlong",
            "bar*",
            "2*bar",
            "degC/s",
            "",
            "bar.real",
            "f(bar)",
            "bar**9",
            "-bar",
        ],
        np.nan,
    ),
}


@pytest.mark.parametrize("text", COMPOUND)
def test_compound_units(text: str, abc: Ruleset) -> None:
    """Products, quotients, brackets and powers of the closed list, and nothing else."""
    found = parse_unit(text, abc.units)
    factor = np.nan if found is None else found.factor
    assert COMPOUND[text] == pytest.approx(factor, rel=1e-12, nan_ok=True)


def test_noise_is_that_of_the_readings() -> None:
    """White noise is found again beside steps, slopes and gaps; a constant has none."""
    random = np.random.default_rng(4)
    values = random.normal(0.0, 0.3, 4000)
    values[1000:] += 50.0
    values += np.linspace(0.0, 100.0, 4000)
    values[::7] = np.nan
    assert noise_of(values) == pytest.approx(0.3, rel=0.05)
    assert 0.0 == noise_of(np.full(50, 2.0))
    assert 0.0 == noise_of(np.array([1.0, np.nan]))


def stretches(recording: Recording, ruleset: Ruleset) -> list[tuple[int, int]]:
    noise = {name: noise_of(values) for name, values in recording.values.items()}
    found = find_stretches(recording, ruleset, noise)
    return list(zip(found.first.tolist(), found.last.tolist(), strict=True))


def test_a_settled_recording_is_one_stretch(expected: Recording, abc: Ruleset) -> None:
    assert [(0, 60)] == stretches(expected, abc)


def test_single_missing_readings_do_not_end_a_stretch(
    tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    """Every second reading of one sensor lost: the plant stood still all the same."""
    sheet = SHEET.mapped("A.dp", lambda k, c: "" if k % 2 else c)
    assert [(0, 60)] == stretches(read(sheet.text(), tmp_path, abc), abc)


def test_a_step_hidden_by_missing_readings_ends_a_stretch(tmp_path: Path, abc: Ruleset) -> None:
    sheet = SHEET.filled("A.dp", "", 30, 32)
    sheet = sheet.mapped("A.dp", lambda k, c: str(float(c) + 1.0) if k >= 32 else c)
    assert [(0, 32), (33, 60)] == stretches(read(sheet.text(), tmp_path, abc), abc)


def test_a_sensor_that_falls_silent_ends_a_stretch(tmp_path: Path, abc: Ruleset) -> None:
    sheet = SHEET.filled("A.dp", "", 30, 45)
    assert [(0, 30), (30, 45), (45, 60)] == stretches(read(sheet.text(), tmp_path, abc), abc)


def test_pauses_and_steps_end_a_stretch(tmp_path: Path, abc: Ruleset) -> None:
    """A pause of the recording; a jump of a reading, with the sample that may average over it."""
    pause = SHEET.mapped("time", lambda k, c: str(k + 100 * (k >= 20)))
    assert [(0, 20), (20, 60)] == stretches(read(pause.text(), tmp_path, abc), abc)
    step = SHEET.mapped("A.n", lambda k, c: str(float(c) + 200 * (k >= 20)))
    assert [(0, 20), (21, 60)] == stretches(read(step.text(), tmp_path, abc), abc)


def test_slow_change_ends_no_stretch_but_long_ones_are_cut(tmp_path: Path, abc: Ruleset) -> None:
    rows = [SHEET.rows[k % 60] for k in range(150)]
    sheet = Sheet(SHEET.header, tuple(rows)).mapped("time", lambda k, _: str(k))
    assert [(0, 50), (50, 100), (100, 150)] == stretches(read(sheet.text(), tmp_path, abc), abc)


def test_dates_keep_their_zone(tmp_path: Path, abc: Ruleset) -> None:
    """Wall-clock time as it stood in the file, whatever its zone; without one as it stood."""
    for zone, shown in (("+02:00", "2025-03-31T23:59:50+02:00"), ("", "2025-03-31T23:59:50")):
        stamped = SHEET.mapped("time", lambda k, _, z=zone: f"2025-03-31T23:59:{k:02d}{z}")  # type: ignore[misc]
        found = read(stamped.text(), tmp_path, abc)
        assert found.calendar is not None
        assert shown == found.calendar.iso(50.0)
        assert "23:59:50" == found.calendar.clock(50.0, 0.0)
