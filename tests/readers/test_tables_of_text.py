"""CSV files and workbooks as loggers and historians write them."""

import dataclasses
import io
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import pytest
from rulec_runtime.contract.ruleset import ColumnMap, Ruleset
from rulec_runtime.recordings import text_table
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording

from rulec.passes.pipeline import compile_plant
from tests.conftest import Patch
from tests.readers.test_formats import same
from tests.runtime.sheets import Sheet, write
from tests.runtime.test_recording import BARE, SHEET, read

UNITS = tuple(title.partition("[")[2].strip("]") for title in SHEET.header)


def test_a_word_has_no_decimal_sign(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """Neither k.A. among numbers with a decimal comma, nor a header that a logger repeats."""
    first, *rest = SHEET.german().splitlines()
    lines = [first, *rest[:30], first, rest[30].replace(";1,8", ";k.A.;1,8", 1), *rest[31:]]
    cells = lines[32].split(";")
    del cells[cells.index("k.A.") + 1]
    lines[32] = ";".join(cells)
    found = read("\n".join(lines) + "\n", tmp_path, abc)
    assert np.flatnonzero(np.isnan(found.values["A.dp"])).tolist() == [30]
    for name, values in expected.values.items():
        kept = slice(None, 30) if name == "A.dp" else slice(None)
        np.testing.assert_array_equal(found.values[name][kept], values[kept])


def test_units_below_the_titles(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """They count as those in titles do; where both contradict, the title counts, and a note names
    both."""
    brackets = tuple(f"[{unit}]" for unit in UNITS)
    for units in (UNITS, brackets, tuple(f"({unit})" for unit in UNITS), ("", *UNITS[1:])):
        found = read(Sheet(BARE.header, (units, *BARE.rows)).text(), tmp_path, abc)
        same(expected, found)
        assert () == found.notes
    units = ("s", *("mbar" if title == "A.dp [bar]" else "" for title in SHEET.header[1:]))
    found = read(Sheet(SHEET.header, (units, *SHEET.rows)).text(), tmp_path, abc)
    same(expected, found)
    assert (
        "x.csv: the file says that 'A.dp [bar]' is in 'mbar', and its title says otherwise; its "
        "title counts",
    ) == found.notes


def long_rows(late: float = 0.0, of: str = "") -> list[tuple[str, str, str, str]]:
    """Tag, time, value and unit of each reading; those of one tag `late`, s."""
    return [
        (title, str(float(row[0]) + (late if title == of else 0.0)), row[i], UNITS[i])
        for row in SHEET.rows
        for i, title in enumerate(BARE.header)
        if i
    ]


def lines(rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join(",".join(row) for row in [("tag", "time [s]", "value", "unit"), *rows]) + "\n"


def test_long_table(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """A reading a row, with its unit: the same recording, in any order of rows and format."""
    found = read(lines(sorted(long_rows())), tmp_path, abc)
    same(expected, found)
    assert ("x.csv: a reading a row; 13 tags became columns",) == found.notes
    tag, time, value, unit = zip(*long_rows(), strict=True)
    table = {"tag": pa.array(tag).dictionary_encode(), "time": np.array(time, dtype=float)}
    table |= {"value": np.array(value, dtype=float), "unit": unit}
    pa.parquet.write_table(pa.table(table), tmp_path / "x.parquet")
    same(expected, read_recording(tmp_path / "x.parquet", abc))
    with pytest.raises(RecordingRefused, match=r"readings of 'A\.dp' are in 'bar' and in 'mbar'"):
        read(lines([*long_rows(), ("A.dp", "99", "1800", "mbar")]), tmp_path, abc)


def test_a_tag_of_which_no_reading_has_a_time(tmp_path: Path, abc: Ruleset) -> None:
    """Its column is empty; it was an error of an index."""
    rows = [f"A.n,{k},900\nA.dp,{k},1.8\n" for k in range(30)]
    file = write(tmp_path, f"Tag,Time,Value\n{''.join(rows)}A.l,,0.2\n")
    recording = read_recording(file, abc)
    assert 30 == len(recording)
    assert not np.isfinite(recording.values["A.l"]).any()


def test_long_table_with_times_of_their_own(
    tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    """A reading stands in the row nearest to it, within half a row, and how far it was moved is
    told; beyond that it has no row."""
    found = read(lines(long_rows(0.3, "A.dp")), tmp_path, abc)
    same(expected, found)
    assert (
        "x.csv: 60 readings were taken at other times than those of 'A.n'; each stands in the row "
        "nearest to it, at most 0.3 away"
    ) in found.notes
    seldom = [r for r in long_rows() if r[0] != "A.dp" or float(r[1]) % 10 == 0]
    found = read(lines(seldom), tmp_path, abc)
    assert [0, 10, 20, 30, 40, 50] == np.flatnonzero(np.isfinite(found.values["A.dp"])).tolist()
    gone = [(t, str(float(s) + 600.4) if t == "A.dp" else s, v, u) for t, s, v, u in long_rows()]
    with pytest.raises(RecordingRefused, match="expected seconds, or dates"):
        read(lines((t, "soon", v, u) for t, _, v, u in gone), tmp_path, abc)
    found = read(lines(gone), tmp_path, abc)
    assert "x.csv: A.dp has not one reading" in found.notes
    assert any("60 readings have no row of 'A.n' near" in note for note in found.notes)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_node_ids_are_titles(
    separator: str, tmp_path: Path, abc: Ruleset, expected: Recording
) -> None:
    """Their own semicolon separates nothing, quoted or not."""
    columns = (
        ColumnMap("A.dp", "ns=2;s=A.dp", 1e5, 0.0),
        ColumnMap("A.n", "ns=2;i=1005", 1 / 60, 0.0),
    )
    mapped = dataclasses.replace(abc, columns=columns)
    sheet = SHEET.renamed("A.dp", "ns=2;s=A.dp").renamed("A.n", "ns=2;i=1005")
    plain = sheet.text(separator)
    quoted = separator.join(f'"{title}"' for title in sheet.header)
    for text in (plain, f"{quoted}\n{plain.partition(chr(10))[2]}"):
        found = read(text, tmp_path, mapped)
        same(expected, dataclasses.replace(found, scales=expected.scales))


def zoned(abc: Ruleset) -> Ruleset:
    return dataclasses.replace(abc, time_zone="Europe/Berlin")


def test_named_zone(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """Dates without a zone are of the plant's, with summer time; the calendar tells both offsets.
    Of the hour that is shown twice, the second is what stands behind the step back."""
    utc = [np.datetime64("2025-10-26T00:30:00") + np.timedelta64(90 * k, "s") for k in range(60)]
    ahead = [2 if date < np.datetime64("2025-10-26T01:00:00") else 1 for date in utc]
    wall = [str(d + np.timedelta64(h, "h")) for d, h in zip(utc, ahead, strict=True)]
    found = read(SHEET.mapped("time", lambda k, _: wall[k]).text(), tmp_path, zoned(abc))
    assert [90.0 * k for k in range(60)] == found.time.tolist()
    assert not found.clock
    assert found.calendar is not None
    assert "UTC+02:00 and UTC+01:00" == found.calendar.zone()
    assert "2025-10-26T02:30:00+02:00" == found.calendar.iso(0.0)
    assert "2025-10-26T02:30:00+01:00" == found.calendar.iso(3600.0)


def test_whose_zone_counts(tmp_path: Path, abc: Ruleset, column_map: Path) -> None:
    """That of a date before that of the plant, which its column map names. Hours that it repeats or
    leaves out are told; a ruleset may name one that is unknown here."""
    column_map.write_text("columns:\n  time: {from: Zeit, unit: s, zone: Europe/Berlin}\n")
    assert "Europe/Berlin" == compile_plant(column_map.parent).time_zone
    sheet = SHEET.mapped("time", lambda k, _: f"2025-07-01T12:00:{k:02d}Z")
    found = read(sheet.text(), tmp_path, zoned(abc))
    assert found.calendar is not None
    assert "UTC" == found.calendar.zone()
    for day, expected in (
        ("2025-10-26T02:10", "rows are in the hour that Europe/Berlin shows twice"),
        ("2025-03-30T02:10", "rows are in the hour that Europe/Berlin leaves out; is the zone ri"),
    ):
        text = sheet.text().replace("2025-07-01T12:00", day).replace("Z,", ",")
        assert any(expected in note for note in read(text, tmp_path, zoned(abc)).notes)
    strange = dataclasses.replace(abc, time_zone="../../etc/passwd")
    with pytest.raises(RecordingRefused, match="does not know the time zone"):
        read(sheet.text().replace("Z,", ","), tmp_path, strange)


def test_sheets_of_several_rates(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """Nothing puts them on one clock: one is named behind the file."""
    book = openpyxl.Workbook()
    for name, step in (("fast", 1), ("slow", 10)):
        page = book.create_sheet(name)
        page.append(SHEET.header)
        for row in SHEET.rows[::step]:
            page.append([float(cell) for cell in row])
    book.save(tmp_path / "x.xlsx")
    with pytest.raises(RecordingRefused, match="2 tables with times of their own") as caught:
        read_recording(tmp_path / "x.xlsx", abc)
    assert "name one, as in 'x.xlsx#fast': 'fast'" in str(caught.value)
    same(expected, read_recording(tmp_path / "x.xlsx#fast", abc))
    assert 6 == len(read_recording(tmp_path / "x.xlsx#slow", abc))
    assert 6 == len(read_recording(Path(f"{tmp_path}#slow"), abc))
    with pytest.raises(RecordingRefused, match="there is no table 'medium' in it: 'fast'"):
        read_recording(tmp_path / "x.xlsx#medium", abc)


def test_a_cell_in_quotes_that_goes_on_behind_the_last_row_of_a_part(monkeypatch: Patch) -> None:
    monkeypatch.setattr(text_table, "BATCH", 8)
    lines = ["time,a,b", *(f"{i},{i},1" for i in range(7)), '7,"7', '",2', "8,8,3"]
    text = "\n".join(lines).encode()
    (sheet,) = text_table.sheets(io.BytesIO(text), Path("x.csv"), ("time",))
    assert sheet.read([0], [1, 2]).columns[1].numbers().tolist() == [1.0] * 7 + [2.0, 3.0]
