"""The reader of recordings: whatever a logger writes, the same numbers or a clear message."""

import dataclasses
import gzip
import re
import time
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import ColumnMap, Ruleset
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording
from rulec_runtime.recordings.stationary import find_stretches, noise_of

from tests.conftest import ROOT
from tests.runtime.mismatch.made import changed
from tests.runtime.sheets import Sheet, example, write

SHEET = example()


def read(content: str | bytes, folder: Path, ruleset: Ruleset, name: str = "x.csv") -> Recording:
    return read_recording(write(folder, content, name), ruleset)


@pytest.fixture
def expected(abc: Ruleset) -> Recording:
    return read_recording(ROOT / "plants" / "abc" / "examples" / "healthy.csv", abc)


def same(expected: Recording, found: Recording) -> None:
    np.testing.assert_allclose(found.time, expected.time, rtol=0, atol=1e-6)
    assert set(expected.values) == set(found.values)
    for name, values in expected.values.items():
        np.testing.assert_allclose(found.values[name], values, rtol=1e-12, err_msg=name)


UNITS = {
    "mbar": SHEET.scaled("A.dp", 1e3, "A.dp [mbar]"),
    "psi": SHEET.scaled("A.dp", 1e5 / 6894.757293168361, "A.dp [psi]"),
    "kgf/cm2": SHEET.scaled("A.dp", 1e5 / 98066.5, "A.dp [kgf/cm2]"),
    "raised m³/h": SHEET.scaled("A.Q", 1e-3, "A.Q [m³/h]"),
    "m^3/s": SHEET.scaled("A.Q", 1e-3 / 3600, "A.Q [m^3/s]"),
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


@pytest.mark.parametrize("name", [*UNITS, *FORMS])
def test_form_of_the_file_changes_nothing(
    name: str, tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    found = read(FORMS[name] if name in FORMS else UNITS[name].text(), tmp_path, abc)
    same(expected, found)
    assert () == found.notes


DATES = {
    "ISO": lambda k: f"2025-03-30T01:59:{k:02d}",
    "with a zone": lambda k: f"2025-03-30T01:59:{k:02d}+02:00",
    "decimal comma": lambda k: f"30.3.2025 01:59:{k:02d},000",
}


def test_dates_count_from_the_first_and_keep_their_zone(
    tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    for date in DATES.values():
        sheet = SHEET.mapped("time", lambda k, _, date=date: date(k)).renamed("time", "Zeit")  # type: ignore[misc]
        found = read(sheet.text(";"), tmp_path, abc)
        same(expected, found)
        (note,) = found.notes
        assert note.startswith("time 0 s is 2025-03-")
    # Wall-clock time as it stood in the file, whatever its zone; without one as it stood.
    for zone, shown in (("+02:00", "2025-03-31T23:59:50+02:00"), ("", "2025-03-31T23:59:50")):
        stamped = SHEET.mapped("time", lambda k, _, z=zone: f"2025-03-31T23:59:{k:02d}{z}")  # type: ignore[misc]
        found = read(stamped.text(), tmp_path, abc)
        assert shown == found.calendar.iso(50.0)
        assert "23:59:50" == found.calendar.clock(50.0, 0.0)


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


def titled(title: str, column: str = "A.dp") -> str:
    return SHEET.renamed(column, title).text()


TEXT, PACKED = SHEET.text(), gzip.compress(SHEET.text().encode())
BARE = Sheet(tuple(title.partition(" [")[0] for title in SHEET.header), SHEET.rows)
FOREIGN = "time [s],PS1 [bar],EPS1 [W]\n0,160,2400\n1,160,2400\n"
MIXED = SHEET.mapped("A.dp", lambda k, c: c.replace(".", ",") if k % 2 else c)
REFUSED: list[tuple[str, str | bytes]] = [
    ("did you mean 'bar'", titled("A.dp [barr]")),
    ("unknown unit 'bar(g)'", titled("A.dp [bar(g)]")),
    ("unknown unit", titled("A.dp [__import__('os')]")),
    ("unknown unit", titled("A.dp [bar**9**9**9]")),
    ("in W, but A.dp is measured in bar; are two swapped?", titled("A.dp [W]")),
    ("'A.dp [bar]' and 'A.dp [Pa]'; take one of them out", titled("A.dp [Pa]", "A.Q")),
    ("the file is empty", ""),
    ("the file is empty", "\n \n\n"),
    ("a header but no rows", TEXT.split("\n")[0]),
    ("binary file; export the recording as CSV", bytes(range(256)) * 20),
    ("cannot be read as Excel file", b"PK\x03\x04\x14\x00\x06\x00" + bytes(100)),
    ("an old Excel; save it as .xlsx", b"\xd0\xcf\x11\xe0" + bytes(100)),
    ("a pickle of Python, which may run anything", b"\x80\x04cposix\nsystem\n."),
    ("cannot be read", PACKED[:500]),
    ("cannot be read", PACKED[:200] + bytes(50) + PACKED[250:]),
    ("no time column; expected 'time [s]'", titled("sample", "time")),
    ("holds 'früh'; expected seconds", SHEET.filled("time", "früh").text()),
    ("is in 'bar'; expected s, ms, min", titled("time [bar]", "time")),
    ("line below the header holds words", TEXT.replace("\n", ("\ns" + ",rpm" * 13) * 2 + "\n", 1)),
    ("unknown unit 'furlong'", BARE.text().replace("\n", "\ns" + ",furlong" * 13 + "\n", 1)),
    ("is the decimal sign also the separator?", SHEET.german().replace(";", ",")),
    ("'A.dp [bar]' mixes decimal comma and decimal point", MIXED.text(";")),
    ("no column belongs to this plant. Expected columns such as 'A.n [rpm]'", FOREIGN),
    ("no time column", "Dear colleague,\nhere is the file.\n"),
]


@pytest.mark.parametrize(("message", "content"), REFUSED)
def test_what_cannot_be_a_recording_is_refused(
    message: str, content: str | bytes, tmp_path: Path, abc: Ruleset
) -> None:
    with pytest.raises(RecordingRefused) as caught:
        read(content, tmp_path, abc)
    assert str(caught.value).startswith(str(tmp_path / "x.csv"))
    assert message in str(caught.value)


DATED = SHEET.mapped("time", lambda k, _: f"2025-03-30 10:{k // 60:02d}:{k % 60:02d}")
RAGGED = SHEET.mapped("A.n", lambda k, c: f"{c},1" if k in (4, 8) else c)
NOTED: list[tuple[str, Sheet]] = [
    ("1 column names no unit; assumed is bar for 'A.dp'", SHEET.renamed("A.dp", "A.dp")),
    ("(the first, in data row 8: 'Störung')", SHEET.filled("A.dp", "Störung", 7, 9)),
    ("2 cells of A.dp are beyond any sensor", SHEET.filled("A.dp", "9.96921e36", 5, 7)),
    ("2 cells of A.P_el are beyond any sensor", SHEET.filled("A.P_el", "inf", 5, 7)),
    ("A.dp has not one reading", SHEET.filled("A.dp", "")),
    ("30 rows repeat the time", SHEET.mapped("time", lambda k, _: str(k // 2))),
    ("2 rows have no usable time", SHEET.filled("time", "Bad", 4, 6)),
    ("2 rows have no usable time", DATED.filled("time", "0", 4, 6)),
    ("not in order of time; they are now", Sheet(SHEET.header, SHEET.rows[::-1])),
    ("matches no signal of this plant; is this a rec", SHEET.renamed("A.Q", "A.flow [l/h]")),
    ("belong to no signal of this plant: 'A_dp [bar]'", SHEET.renamed("A.dp", "A_dp [bar]")),
    ("than the header and are left out (the first is data row 5)", RAGGED),
]


@pytest.mark.parametrize(("message", "sheet"), NOTED)
def test_what_can_be_read_in_part_is_noted(
    message: str, sheet: Sheet, tmp_path: Path, abc: Ruleset
) -> None:
    found = read(sheet.text(), tmp_path, abc)
    assert any(message in note for note in found.notes), found.notes
    assert np.all(np.diff(found.time) > 0)
    assert sheet is not RAGGED or not {4.0, 8.0} & set(found.time)
    assert all(not np.isinf(values).any() for values in found.values.values())


def test_blank_words_need_no_remark(tmp_path: Path, abc: Ruleset) -> None:
    words = ("", "NA", "n/a", "NaN", "null", "None", "-")
    sheet = SHEET.mapped("A.dp", lambda k, c: words[k] if k < len(words) else c)
    found = read(sheet.text(), tmp_path, abc)
    assert () == found.notes
    assert [*range(len(words))] == np.flatnonzero(np.isnan(found.values["A.dp"])).tolist()


def test_columns_by_their_names(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """A column T that stands before that of times is a temperature."""
    found = read(SHEET.without("A.dp", "B.P_el", "A.T").text(), tmp_path, abc)
    assert ("A.dp", "B.P_el") == found.missing
    times, *others = SHEET.renamed("time", "t").text().splitlines()
    rows = [f"T [°C],{times}", *(f"21.5,{row}" for row in others)]
    same(expected, read("\n".join(rows) + "\n", tmp_path, abc))


def test_foreign_column_map(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """A sensor that several modules read stands once in the file."""
    columns = (
        ColumnMap("A.dp", "PT 101 Ist", 100.0, 0.0),
        ColumnMap("A.T", "TT-101", 1.0, 273.15),
        ColumnMap("B.T", "TT-101", 1.0, 273.15),
        ColumnMap("A.n", "SE_1 [U/min]", 1 / 60, 0.0),
    )
    foreign = dataclasses.replace(abc, columns=columns, time_column="Zeitstempel")
    sheet = SHEET.without("B.T").scaled("A.dp", 1e3, "PT 101 Ist").renamed("A.T", "TT-101")
    sheet = sheet.renamed("A.n", "SE_1 [U/min]").renamed("time", "Zeitstempel")
    found = read(sheet.german(), tmp_path, foreign)
    same(changed(expected, {"B.T": expected.values["A.T"]}), found)
    twice = sheet.renamed("A.Q", "A.dp [bar]")
    with pytest.raises(RecordingRefused, match=r"two columns hold A\.dp: 'PT 101 Ist' and"):
        read(twice.text(), tmp_path, foreign)


def test_folder_in_order_of_time(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    first, second = Sheet(SHEET.header, SHEET.rows[:25]), Sheet(SHEET.header, SHEET.rows[25:])
    write(tmp_path, second.german(), "run1.CSV")
    write(tmp_path, gzip.compress(first.text().encode()), "run10.csv.gz")
    write(tmp_path, "not a recording", "notes.txt")
    found = read_recording(tmp_path, abc)
    same(expected, found)
    assert [25, 35] == np.bincount(found.segment).tolist()
    assert found.one_clock
    assert () == found.notes


def test_folder_with_times_that_start_anew(tmp_path: Path, abc: Ruleset) -> None:
    for name in ("c.csv", "a.csv", "b.csv"):
        write(tmp_path, (SHEET.without("A.dp") if name == "b.csv" else SHEET).text(), name)
    found = read_recording(tmp_path, abc)
    np.testing.assert_array_equal(np.arange(180.0), found.time)
    assert not found.one_clock
    assert "a.csv from 0 s, b.csv from 60 s, c.csv from 120 s" in found.notes[0]
    readable = np.isfinite(found.values["A.dp"])
    assert [True] * 60 + [False] * 60 + [True] * 60 == readable.tolist()
    assert () == found.missing


def test_no_file_and_folders_that_are_refused(tmp_path: Path, abc: Ruleset) -> None:
    for name in ("nothing.csv", "."):
        with pytest.raises(RecordingRefused, match=r"there is no such file|holds no \.csv"):
            read_recording(tmp_path / name, abc)
    write(tmp_path, SHEET.text(), "a.csv")
    dated = SHEET.mapped("time", lambda k, _: DATES["ISO"](k))
    write(tmp_path, dated.text(), "b.csv")
    with pytest.raises(RecordingRefused, match="some files of this folder have dates"):
        read_recording(tmp_path, abc)


def test_compound_units(abc: Ruleset) -> None:
    for text, factor in {
        "bar/(l/h)": 1e5 * 3.6e6,
        "bar/(l/h)**2": 1e5 * 3.6e6**2,
        "l/(min*bar)": 1e-3 / 6e6,
        "W*s": 1.0,
        "mm/s^2": 1e-3,
        "%": 0.01,
        "1": 1.0,
    }.items():
        found = parse_unit(text, abc.units)
        assert factor == pytest.approx(found.factor, rel=1e-12)
    for text in ("bar(g)", "furlong", "bar*", "2*bar", "degC/s", "", "bar.real", "f(bar)", "-bar"):
        assert parse_unit(text, abc.units) is None, text


def test_noise_is_that_of_the_readings() -> None:
    random = np.random.default_rng(4)
    values = random.normal(0.0, 0.3, 4000)
    values[1000:] += 50.0
    values += np.linspace(0.0, 100.0, 4000)
    values[::7] = np.nan
    assert noise_of(values) == pytest.approx(0.3, rel=0.05)
    assert 0.0 == noise_of(np.full(50, 2.0))
    assert 0.0 == noise_of(np.array([1.0, np.nan]))


def test_the_noise_of_a_coarse_display_is_that_of_its_flicker() -> None:
    """Three samples of four show the same number; set points are held, and are no noise."""
    draw, held = np.random.default_rng(4), np.repeat([40.0, 52.0, 47.0, 40.0], 100)
    shown = np.round(held + draw.normal(0.1, 0.3, len(held)))
    assert noise_of(shown) == pytest.approx(np.std(shown - held), rel=0.25)
    shown[50] += 20.0
    assert noise_of(shown) == pytest.approx(0.3, rel=0.25)
    held[[50, 150, 250]] += 8.0
    assert 0.0 == noise_of(held)
    assert 0.0 == noise_of(np.array([1.0, np.nan]))


LONG = Sheet(SHEET.header, SHEET.rows * 2 + SHEET.rows[:30]).mapped("time", lambda k, _: str(k))
LOST = SHEET.filled("A.dp", "", 30, 32)
STEP = [0.0] * 20 + [0.5] + [1.0] * 39
STRETCHES: dict[str, tuple[Sheet, list[tuple[int, int]]]] = {
    "settled": (SHEET, [(0, 60)]),
    # The plant stood still all the same where every second reading of one sensor is lost.
    "every second lost": (SHEET.mapped("A.dp", lambda k, c: c * (k % 2)), [(0, 60)]),
    "a step hidden by missing readings": (
        LOST.mapped("A.dp", lambda k, c: str(float(c) + 1.0) if k >= 32 else c),
        [(0, 32), (33, 60)],
    ),
    "a sensor falls silent": (SHEET.filled("A.dp", "", 30, 45), [(0, 30), (30, 45), (45, 60)]),
    "a pause": (SHEET.mapped("time", lambda k, _: str(k + 100 * (k >= 20))), [(0, 20), (20, 60)]),
    # With the sample that may average over the step.
    "a step": (
        SHEET.mapped("A.n", lambda k, c: str(float(c) + 200 * (k >= 20))),
        [(0, 20), (21, 60)],
    ),
    # Less than noise might do between two samples, or between three and three.
    "a small step with a reading between": (
        SHEET.mapped("A.P_el", lambda k, _: str(150.0 + 1.5 * (-1) ** k + 16 * STEP[k])),
        [(0, 20), (21, 60)],
    ),
    "long ones are cut": (LONG, [(0, 50), (50, 100), (100, 150)]),
}


@pytest.mark.parametrize("name", STRETCHES)
def test_what_ends_a_stretch(name: str, tmp_path: Path, abc: Ruleset) -> None:
    sheet, expected = STRETCHES[name]
    recording = read(sheet.text(), tmp_path, abc)
    noise = {name: noise_of(values) for name, values in recording.values.items()}
    found = find_stretches(recording, abc, noise)
    assert expected == list(zip(found.first.tolist(), found.last.tolist(), strict=True))
