"""Files as historians, SCADA systems, test benches and spreadsheets write them: the same recording
in each form, or a refusal that names the key of the column map; never something else in silence."""

import dataclasses
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest
from rulec_runtime.contract.ruleset import ColumnMap, Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.csv_table import Unclear
from rulec_runtime.recordings.recording import Recording, RecordingRefused, read_recording

from rulec.cli import main
from rulec.commands.column_map import proposed
from rulec.passes.pipeline import Compilation, run_passes
from tests.conftest import ROOT
from tests.readers.conftest import ABC
from tests.runtime.sheets import Sheet, write
from tests.runtime.test_recording import SHEET, same

CASES = ROOT.parent / "shared" / "cases"
NAMES = tuple(title.partition(" [")[0] for title in SHEET.header[1:])
BARE = Sheet(("Timestamp", *NAMES), SHEET.rows)
START = datetime(2025, 3, 31, 14, 5, 0)


def at(k: int) -> datetime:
    return START + timedelta(seconds=k)


def stamped(stamp: Callable[[datetime], str], name: str = "Timestamp", cut: str = ",") -> str:
    """With dates, each written so."""
    sheet = BARE.mapped("Timestamp", lambda k, _: stamp(at(k)))
    return sheet.renamed("Timestamp", name).text(cut)


def shown(pattern: str) -> Callable[[datetime], str]:
    return lambda date: date.strftime(pattern)


def since(day: datetime, unit: float) -> Callable[[datetime], str]:
    return lambda date: repr(round((date - day) / timedelta(seconds=unit), 12)).removesuffix(".0")


def german(date: datetime) -> str:
    months = ("Jan", "Feb", "Mär", "Apr", "Mai", "Jun", "Jul", "Aug", "Sep", "Okt", "Nov", "Dez")
    return f"{date.day}. {months[date.month - 1]} {date.year} {date:%H:%M:%S}"


UNIX = datetime(1970, 1, 1)

Mapped = Callable[..., Ruleset]

DATES = {
    "historian": shown("%d-%b-%y %H:%M:%S"),
    "American, AM and PM": shown("%m/%d/%Y %I:%M:%S %p"),
    "British": shown("%d/%m/%Y %H:%M:%S"),
    "year first, slashes": shown("%Y/%m/%d %H:%M:%S"),
    "year first, two digits": shown("%y-%m-%d %H:%M:%S"),
    "German": shown("%d.%m.%Y %H:%M:%S"),
    "German, in words": german,
    "in words": shown("%B %d %Y %H:%M:%S"),
    "milliseconds behind a colon": shown("%d.%m.%Y %H:%M:%S:000"),
    "day of the week": shown("%a %d %b %Y %H:%M:%S"),
    "with a zone": shown("%d.%m.%Y %H:%M:%S UTC"),
    "compact": shown("%Y%m%dT%H%M%S"),
    "digits alone": shown("%Y%m%d%H%M%S"),
    "Unix, s": since(UNIX, 1),
    "Unix, ms": since(UNIX, 1e-3),
    "Unix, us": since(UNIX, 1e-6),
    "Unix, ns": lambda date: f"{round((date - UNIX).total_seconds())}000000000",
    "spreadsheet": since(datetime(1899, 12, 30), 86400),
    "LabVIEW": since(datetime(1904, 1, 1), 1),
    "Windows": lambda date: f"{round((date - datetime(1601, 1, 1)).total_seconds())}0000000",
}


def grouped(mark: str, decimal: str, digits: int = 6) -> str:
    """Numbers with marks of thousands; speeds are per hour, so that they have some."""
    sheet = SHEET.scaled("A.n", 60.0, "A.n [1/h]")

    def cell(text: str) -> str:
        number = f"{float(text):,.{digits}f}".replace(",", "_").replace(".", decimal)
        return number.replace("_", mark)

    rows = tuple((row[0], *map(cell, row[1:])) for row in sheet.rows)
    return dataclasses.replace(sheet, rows=rows).text(";")


def long(head: str, line: str, stamp: Callable[[datetime], str] = str) -> str:
    """A reading a row; `line` has places for tag, time, value and the number of the tag."""
    rows = [
        line.format(tag=tag, time=stamp(at(k)), value=cell, comma=cell.replace(".", ","), number=n)
        for k, row in enumerate(SHEET.rows)
        for n, (tag, cell) in enumerate(zip(NAMES, row[1:], strict=True))
    ]
    return "\n".join([head, *rows]) + "\n"


def parts(head: str, stamp: str, cut: str = ",") -> str:
    rows = [
        cut.join([*at(k).strftime(stamp).split("|"), *row[1:]]) for k, row in enumerate(SHEET.rows)
    ]
    return "\n".join([cut.join([head.replace("|", cut), *NAMES]), *rows]) + "\n"


def beside(title: str, cell: str, time: bool = False, before: bool = False) -> str:
    """Each column with another one of its own."""

    def both(name: str, own: str) -> str:
        return f"{own},{name}" if before else f"{name},{own}"

    head = ["Time", *(both(name, title.format(name)) for name in NAMES)]
    rows = [
        [f"{at(k)}", *(both(value, f"{at(k)}" if time else cell) for value in row[1:])]
        for k, row in enumerate(SHEET.rows)
    ]
    start = 1 if time else 0
    return "\n".join(",".join(row[start:]) for row in [head, *rows]) + "\n"


def lvm(columns: str, decimal: str = ".", date: bool = True) -> str:
    """A LabVIEW measurement file, in two parts with a header each."""
    n, day = len(NAMES), f"Date\t{START:%Y/%m/%d}\n" if date else ""
    titles = {"One": ["X_Value", *NAMES], "No": ["X_Value", *NAMES],
              "Multi": [t for name in NAMES for t in ("X_Value", name)]}[columns]  # fmt: skip
    units = [t.partition("[")[2][:-1] for t in SHEET.header[1:]]
    text = (
        f"LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        f"Decimal_Separator\t{decimal}\nMulti_Headings\tYes\nX_Columns\t{columns}\n"
        f"Time_Pref\tRelative\nOperator\tlab\n{day}"
        + (f"Time\t{START:%H:%M:%S}.0\n" if date else "")
        + "***End_of_Header***\t\n\t\n"
    )
    for low in (0, 30):
        begin = f"{at(low) if columns == 'No' else START:%H:%M:%S}.0"
        for word, cells in {
            "Channels": [str(n)],
            "Samples": ["30"] * n,
            **({"Date": [f"{START:%Y/%m/%d}"], "Time": [begin] * n} if date else {}),
            "Y_Unit_Label": units,
            "X0": ["0.0"] * n,
            "Delta_X": ["1.0"] * n,
        }.items():
            text += "\t".join([word, *cells]) + "\n"
        text += "***End_of_Header***\t\n" + "\t".join([*titles, "Comment"]) + "\n"
        for time, *row in SHEET.rows[low : low + 30]:
            x = f"{float(time):.6f}"
            cells = {"One": [x, *row], "No": ["", *row],
                     "Multi": [t for cell in row for t in (x, cell)]}[columns]  # fmt: skip
            text += "\t".join(cells).replace(".", decimal) + "\t\n"
        text += "\n"
    return text


def influx(measurement: str, field: str, tags: str = "", pivot: bool = False) -> str:
    """Annotated CSV; `measurement`, `field` and a tag have places for module and signal."""
    own, _, tag = tags.partition("=")
    blocks = []
    for names in (NAMES[:3], NAMES[3:]) if pivot else ((name,) for name in NAMES):
        module, _, signal = names[0].partition(".")
        titles = "".join(f",{n}" for n in names) if pivot else ",_value,_field"
        kinds = ",double" * len(names) if pivot else ",double,string"
        group = ",false" * len(names) if pivot else ",false,true"
        blocks.append(
            f"#group,false,false,true,false{group},true{',true' * bool(tags)}\n"
            f"#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339{kinds},string"
            f"{',string' * bool(tags)}\n#default,_result,,,,,,\n"
            f",result,table,_start,_time{titles},_measurement{f',{own}' * bool(tags)}\n"
        )
        for k, row in enumerate(SHEET.rows):
            cells = [row[NAMES.index(n) + 1] for n in names]
            cells += [*([] if pivot else [field]), measurement, *([tag] if tags else [])]
            line = f",,0,{START:%Y-%m-%dT%H:%M:%SZ},{at(k):%Y-%m-%dT%H:%M:%SZ},{','.join(cells)}\n"
            blocks.append(line.format(module=module, signal=signal))
        blocks.append("\n")
    return "".join(blocks)


FORMS = {
    "units in round brackets": SHEET.mapped("time", lambda k, _: f"{1000 * k}")
    .text()
    .replace("[s]", "[ms]")
    .translate({ord("["): " (", ord("]"): ")"}),
    "thousands, German": grouped(".", ","),
    "thousands, Swiss": grouped("'", "."),
    "thousands, French": grouped("\u202f", ","),
    "thousands, with a blank": grouped(" ", ","),
    "thousands, English": grouped(",", "."),
    "WinCC": long('"VarName";"TimeString";"VarValue";"Validity";"Time_ms"',
                  '"{tag}";"{time}";{comma};1;45747586805,5556',
                  shown("%d.%m.%Y %H:%M:%S")) + '"$RT_COUNT$";2400;\n',
    "tags and IsGood": long("Tag,Timestamp,Value,IsGood", "{tag},{time},{value},True"),
    "Good (192)": long("Tag,Timestamp,Value,Quality", "{tag},{time},{value},Good (192)"),
    "192": long("tagname,timestamp,value,quality", "{tag},{time},{value},192"),
    "hexadecimal": long("NodeId,Timestamp,Value,StatusCode", "{tag},{time},{value},0x00000000")
    .replace("0x00000000\n", "0x00000400\n", 1),
    "Unix time of a long table": long("name;time;value", "{tag};{time};{value}", since(UNIX, 1e-3)),
    "date, time, milliseconds": parts("Date|Time|Millitm", "%m/%d/%Y|%H:%M:%S|0"),
    "date and time, German": parts("Datum|Uhrzeit", "%d.%m.%Y|%H:%M:%S", ";"),
    "quality columns": beside("{} Quality", "Good"),
    "quality columns, codes": beside("{}_Status", "192"),
    "quality columns without names": beside("Quality", "Good"),
    "bars between cells": SHEET.text("|"),
    "a form above": "Test rig 3\nDate;2025-03-31\nOperator;N. N.\n\n" + SHEET.german(),
    "a table above": "Channel;Serial\nPT1;4711\nTT1;4712\n" + SHEET.german(),
    "words above": "Recorded at night, by hand; see the log\n" + SHEET.german(),
    "pairs": beside("Time", "", time=True, before=True),
    "pairs with names": beside("{} Time", "", time=True, before=True),
    "LabVIEW": lvm("One"),
    "LabVIEW, decimal comma": lvm("One", ","),
    "LabVIEW, an x each": lvm("Multi"),
    "LabVIEW, no x": lvm("No"),
    "LabVIEW, no date": lvm("One", date=False),
    "annotated, a measurement per module": influx("{module}", "{signal}"),
    "annotated, one measurement": influx("plant", "{module}.{signal}", "host=h1"),
    "annotated, a tag per module": influx("pumps", "{signal}", "module={module}"),
    "annotated, pivoted": influx("plant", "", pivot=True),
}  # fmt: skip


def formed(ruleset: Ruleset, **form: Any) -> Ruleset:
    return dataclasses.replace(ruleset, file=dataclasses.replace(ruleset.file, **form))


@pytest.fixture(scope="module")
def mapped(abc: Ruleset, column_map: Path) -> Mapped:
    """The plant abc with a column map: a text, or what is proposed for a file."""

    def with_map(given: Path | str) -> Ruleset:
        text = given if isinstance(given, str) else proposed(given, abc, {}).text
        column_map.write_text(text, encoding="utf-8")
        found = run_passes(Compilation(path=column_map.parent), "plant").plant
        columns = (ColumnMap(c.signal, c.column, c.factor, c.offset) for c in found.columns)
        return dataclasses.replace(
            abc,
            columns=tuple(columns),
            time_column=found.time_column,
            time_zone=found.time_zone,
            file=found.file,
        )

    return with_map


def text_of(name: str) -> str:
    return FORMS[name] if name in FORMS else stamped(DATES[name])


@pytest.mark.parametrize("name", [*FORMS, *DATES, "workbook"])
def test_forms(
    name: str, tmp_path: Path, mapped: Mapped, abc: Ruleset, expected: Recording
) -> None:
    """The same recording, as it stands and with the map that is proposed; dates are dates. In a
    workbook, date and time of day in two columns."""
    file = write(tmp_path, "" if name == "workbook" else text_of(name))
    if name == "workbook":
        book, file = openpyxl.Workbook(), tmp_path / "x.xlsx"
        book.active.append(["Date", "Time", *SHEET.header[1:]])
        for k, row in enumerate(SHEET.rows):
            book.active.append([at(k).date(), at(k).time(), *map(float, row[1:])])
        book.save(file)
    for ruleset in (abc, mapped(file)):
        found = read_recording(file, ruleset)
        same(expected, found)
        if name in DATES:
            assert found.calendar is not None
            assert START.replace(tzinfo=UTC).timestamp() == pytest.approx(found.calendar.start)


def judged(quality: str, good: str) -> str:
    return long(f"Tag,Timestamp,Value,{quality}", "{tag},{time},{value}," + good)


BAD = {
    "word": (judged("Quality", "Good"), "Bad"),
    "IsGood": (judged("IsGood", "True"), "False"),
    "OPC DA": (judged("Quality", "192"), "24"),
    "OPC UA, signed": (judged("Quality", "0"), "-2146631680"),
    "OPC UA, hexadecimal": (judged("Quality", "0x0"), "0x80340000"),
    "uncertain": (judged("Quality", "0"), "1073741824"),
    "WinCC": (long("VarName,TimeString,VarValue,Validity", "{tag},{time},{value},1"), "0"),
    "wide": (beside("{} Quality", "Good"), "Bad  Comm Fail"),
    "wide, codes": (beside("{} [StatusCode]", "0"), "2147483648"),
    "pairs": (beside("{} Time", "", time=True, before=True), "I/O Timeout"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_not_good_is_no_reading(
    name: str, tmp_path: Path, mapped: Mapped, abc: Ruleset
) -> None:
    """And how often is told, with the first place."""
    text, wrong = BAD[name]
    first = next(line for line in text.splitlines() if "1.82216" in line)
    cells = first.split(",")
    cells[cells.index("1.82216") + (name != "pairs")] = wrong
    file = write(tmp_path, text.replace(first, ",".join(cells), 1))
    for ruleset in (abc, mapped(file)):
        found = read_recording(file, ruleset)
        assert [1] == np.flatnonzero(np.isnan(found.values["A.dp"])).tolist()
        assert any("1 cell of A.dp is a word (the first, in data row 2" in n for n in found.notes)
        assert all(np.isfinite(found.values[n]).all() for n in NAMES if n != "A.dp")


def test_one_quality_judges_whole_rows(tmp_path: Path, mapped: Mapped, abc: Ruleset) -> None:
    """Where a wide table has one; a status may be that of the plant, and judges nothing."""
    rows = [(*row, "Good" if k < 50 else "Bad") for k, row in enumerate(SHEET.rows)]
    for title, there in (("Quality", 50), ("Status", 60)):
        file = write(tmp_path, Sheet((*SHEET.header, title), tuple(rows)).text())
        for ruleset in (abc, mapped(file)):
            assert there == np.isfinite(read_recording(file, ruleset).values["C.dp"]).sum()


def test_readings_that_are_written_when_they_change(
    tmp_path: Path, mapped: Mapped, abc: Ruleset, expected: Recording
) -> None:
    """By more than a share of themselves. Without a word on it they are refused; the map that is
    proposed lets them hold."""
    rows, last = [], dict.fromkeys(NAMES, 0.0)
    for k, row in enumerate(SHEET.rows):
        for tag, cell in zip(NAMES, row[1:], strict=True):
            width = 0.0 if tag == "A.dp" else 0.002
            if not k or abs(float(cell) - last[tag]) > width * float(cell):
                last[tag] = float(cell)
                rows.append(f"{tag},{at(k)},{cell},Good")
    file = write(tmp_path, "\n".join(["Tag,Time,Value,Quality", *rows]) + "\n")
    with pytest.raises(Unclear, match=r"file: \{hold: last\}"):
        read_recording(file, abc)
    found = read_recording(file, mapped(file))
    np.testing.assert_array_equal(found.time, expected.time)
    for name in NAMES:
        np.testing.assert_allclose(found.values[name], expected.values[name], rtol=0.0021)
    assert any("a reading holds until the next one of its signal" in n for n in found.notes)


def test_what_holds(tmp_path: Path, abc: Ruleset, expected: Recording) -> None:
    """Nothing beyond a bad quality or for too long. In a table with a column per signal, where its
    map says so, empty cells, by the times wherever their column is; a word ends it."""
    lines = [f"A.dp,{at(k)},{1.8 + k / 1000},Good" for k in range(60)]
    lines += [f"A.n,{at(0)},900,Good", f"A.n,{at(30)},901,Bad"]
    file = write(tmp_path, "Tag,Time,Value,Quality\n" + "\n".join(lines) + "\n")
    for form, until in (({}, 30), ({"hold_for": 5.0}, 6)):
        found = read_recording(file, formed(abc, hold="last", **form))
        there = np.flatnonzero(np.isfinite(found.values["A.n"])).tolist()
        assert [*range(until)] == there
    text = SHEET.filled("A.n", "", 1).filled("A.n", "Bad", 40, 41).text()
    found = read_recording(write(tmp_path, text), formed(abc, hold="last"))
    np.testing.assert_array_equal(found.values["A.n"][:40], expected.values["A.n"][0])
    assert np.isnan(found.values["A.n"][40:]).all()
    warm = dataclasses.replace(abc, columns=(ColumnMap("A.T", "T", 1.0, 273.15),))
    file = write(tmp_path, "T,time,A.dp [bar]\n20,0,1\n19,1,\n18,2,2\n17,3,\n")
    found = read_recording(file, formed(warm, hold="last"))
    assert found.values["A.dp"].tolist() == [1e5, 1e5, 2e5, 2e5]


ASKED = {
    "order of a date": (stamped(lambda d: d.strftime("%d/%m/%Y %H:%M:%S").replace("31", "04", 1)),
                        "may be 4 March 2025 (day first) or 3 April 2025 (month first)",
                        "dates: day first",),
    "days or seconds": (stamped(lambda d: f"{45747 + 5 / 24 * (d - START).seconds / 10:.6f}"),
                        "may count d since 1899-12-30", "since: 1899-12-30",),
    "good is 0": (long("Tag,Time,Value,Quality", "{tag},{time},{value},0"),
                  "every quality is 0, which is good in OPC UA and bad in OPC DA",
                  "good: opc ua",),
}  # fmt: skip


@pytest.mark.parametrize("name", ASKED)
def test_what_only_a_person_knows_is_asked(
    name: str, tmp_path: Path, mapped: Mapped, abc: Ruleset, capsys: pytest.CaptureFixture[str]
) -> None:
    """Refused with the key that helps, with the map too until it is answered there; exit code 1."""
    text, expected, key = ASKED[name]
    file = write(tmp_path, text)
    with pytest.raises(RecordingRefused) as refused:
        read_recording(file, abc)
    assert expected in str(refused.value)
    assert key in str(refused.value)
    assert 1 == main(["check", str(ABC), str(file), "--write-map"])
    shown, aside = capsys.readouterr()
    assert f"# To be answered first: {str(refused.value).partition(': ')[2]}" in shown
    assert "to be answered in the map" in " ".join(aside.split())
    with pytest.raises(Unclear):
        read_recording(file, mapped(shown))


def test_a_number_that_fits_two_conventions(
    tmp_path: Path, mapped: Mapped, abc: Ruleset, expected: Recording
) -> None:
    """54.054 in a file with decimal commas is refused, and the map takes what is likely."""
    speeds = SHEET.scaled("A.n", 60.0, "A.n [1/h]").mapped(
        "A.n", lambda _, cell: f"{round(float(cell)):,}".replace(",", "_")
    )
    file = write(tmp_path, speeds.german().replace("_", "."))
    with pytest.raises(Unclear, match=r"'54.054' may be 54054 or 54.054"):
        read_recording(file, abc)
    found = read_recording(file, mapped(file))
    np.testing.assert_allclose(found.values["A.n"], expected.values["A.n"], rtol=2e-5)


def test_numbers_that_mean_missing(tmp_path: Path, mapped: Mapped, abc: Ruleset) -> None:
    file = write(tmp_path, SHEET.filled("A.dp", "-9999", 20, 30).text())
    text = proposed(file, abc, {}).text
    assert "missing: [-9999]" in text
    found = read_recording(file, mapped(text))
    assert [*range(20, 30)] == np.flatnonzero(np.isnan(found.values["A.dp"])).tolist()
    remark = "10 cells of A.dp are -9999, which the column map calls missing"
    assert any(remark in note for note in found.notes)


NOT_THERE = {
    "a tag": ({"layout": "long", "tag": "Name"}, "there is no column 'Name', which the column map"),
    "pairs": ({"layout": "pairs"}, "the column map says that columns stand in pairs"),
    "a long table": ({"layout": "long"}, "a long table needs a column of tags"),
    "a part of the time": ({"time": ("Day", "Clock")}, "there is no column 'Day', which"),
}


@pytest.mark.parametrize("name", NOT_THERE)
def test_a_map_of_another_file_is_refused(name: str, tmp_path: Path, abc: Ruleset) -> None:
    form, expected = NOT_THERE[name]
    with pytest.raises(RecordingRefused, match=expected):
        read_recording(write(tmp_path, BARE.text()), formed(abc, **form))


def test_signals_are_known_by_their_words(tmp_path: Path, abc: Ruleset) -> None:
    """In titles of another spelling; what is left is listed, and so is what is missing."""
    head = ("Timestamp", *(f"PLANT1/{name.replace('.', '_').upper()}/PV" for name in NAMES[:-1]))
    sheet = Sheet((*head, "Batch"), SHEET.rows)
    text = proposed(write(tmp_path, sheet.text()), abc, {}).text
    assert "A.P_el: {from: PLANT1/A_P_EL/PV, unit: W}  # the file names no unit" in text
    assert "# C.dp: {from: ..., unit: bar}" in text
    assert "# no signal: Batch" in text


@pytest.mark.parametrize("case", sorted(CASES.rglob("*.csv")) + sorted(CASES.rglob("*.lvm")))
def test_shared_cases(case: Path, mapped: Mapped) -> None:
    """With the map that is proposed the three leakages are found."""
    ruleset = mapped(case)
    found = diagnose(read_recording(case, ruleset), ruleset).findings
    degrees = [round(f.degree, 1) for f in found if f.fault.id == "A.leakage"]
    assert [0.2, 0.4, 0.6] == degrees


AGAIN = ("date, time, milliseconds", "pairs", "LabVIEW", "American, AM and PM")


@pytest.mark.parametrize("name", AGAIN)
def test_what_is_simulated_from_it_can_be_read(
    name: str, tmp_path: Path, expected: Recording, abc: Ruleset
) -> None:
    """Written in the form of the file, or as a plain table of the same rows."""
    file, again = write(tmp_path, text_of(name)), tmp_path / "again.csv"
    assert 0 == main(["simulate", str(ABC), str(file), "-o", str(again), "-q"])
    found = read_recording(again, abc)
    np.testing.assert_allclose(found.time, expected.time, atol=2e-6)
    np.testing.assert_allclose(found.values["A.n"], expected.values["A.n"], rtol=1e-12)
    np.testing.assert_allclose(found.values["A.dp"], expected.values["A.dp"], rtol=0.01)
