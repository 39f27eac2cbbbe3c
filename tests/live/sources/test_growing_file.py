"""Files that grow, are rotated, cut and left by a process that was killed; their heads."""

import dataclasses
import json
import os
import random
import re
import time
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.growing_file import GrowingFile
from rulec_runtime.live.sources.table_stream import StandardInput
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.recordings.titles import title_line

from tests.conftest import Patch
from tests.live.sources.taking import Taken, append, growing, lines
from tests.readers.test_strangers import BARE, DATES, FORMS, SHEET, beside, long, stamped
from tests.runtime.sheets import write


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "LINGER", 0.02)


TITLES = "Zeit;A.dp;A.n\n"
UNITS = "ms;[mbar];1/min\n"


def head(date: str = "2026-03-01") -> str:
    return f"Station 4;begun {date}\nrate [Hz];1\n{TITLES}{UNITS}"


def rows(times: range) -> str:
    return "".join(f"{1000 * t:d};{t},5;900\n" for t in times)


FORMS_READ: dict[str, str | bytes] = {
    "CRLF": SHEET.text(newline="\r\n"),
    "German, Latin-1": SHEET.renamed("A.T", "A.T [°C]").german().encode("latin-1"),
    "sep= and remarks": "\ufeffsep=;\n# by a logger\n\n" + SHEET.german(),
    "a head": head() + rows(range(30)),
    "UTF-16": SHEET.text().encode("utf-16"),
    "UTF-16 big": f"\ufeff{SHEET.text()}".encode("utf-16-be"),
    **{
        name: stamped(DATES[name])
        for name in (
            "with a zone",
            "American, AM and PM",
            "digits alone",
            "Unix, ms",
            "spreadsheet",
        )
    },
    **{name: FORMS[name] for name in ("thousands, German", "thousands, Swiss", "quality columns")},
    "codes": "time,A.dp [bar],A.dp Quality,A.n [rpm]\n"
    + "".join(f"{t},1,{192 if t < 9 else 0},900\n" for t in range(12)),
    "an hour shown twice": "time,A.dp [bar],A.n [rpm]\n"
    + "".join(
        f"2025-10-26 {hour:02}:{minute},1,900\n" for hour in (1, 2, 2, 3) for minute in (10, 30, 50)
    ),
    "a bad quality": beside("{} Quality", "Good").replace("1.82216,Good", "1.82216,Bad"),
}


@pytest.mark.parametrize("way", ["in pieces", "started anew", "rotated"])
@pytest.mark.parametrize("name", FORMS_READ)
def test_growing_reads_as_whole(name: str, way: str, tmp_path: Path, abc: Ruleset) -> None:
    """Whatever its pieces, byte by byte even, rows are those of `rulec diagnose`. Signs of numbers,
    order and beginning of dates, codes of qualities are those of its first rows, also for a watch
    that is started anew at any moment, and for the next file."""
    ruleset = dataclasses.replace(abc, time_zone="Europe/Berlin")
    whole, grown = write(tmp_path, FORMS_READ[name]), write(tmp_path, "", "grown.csv")
    data, rest, draw, at = whole.read_bytes(), b"", random.Random(name), 0
    expected, taken = read_recording(whole, ruleset), Taken(GrowingFile(grown, ruleset))
    if way == "rotated":
        sign = "\n".encode("utf-16-be" if "big" in name else "utf-16-le")[:: 1 + ("16" not in name)]
        every = data.split(sign)
        middle, titles = len(every) // 2, 4 if "head" in name or "remarks" in name else 1
        rest = sign.join([*every[:titles], *every[middle:]])
        data = sign.join([*every[:middle], b""])
    while at < len(data):
        step = draw.choice((1, 3, 40, 700))
        append(grown, data[at : at + step])
        at += step
        taken.take()
        if way == "started anew":
            stored = json.loads(json.dumps(taken.source.position))  # type: ignore[attr-defined]
            taken.source.close()
            taken.source = GrowingFile(grown, ruleset, stored)
    if rest:
        os.replace(write(tmp_path, rest, "new.csv"), grown)
        taken.until(lambda t: len(t.times) >= len(expected))
    dated, times = expected.calendar is not None, np.array(taken.take().times)
    assert taken.source.dated == dated
    np.testing.assert_array_equal(times - (times[0] if dated else 0.0), expected.time)
    for signal, values in expected.values.items():
        np.testing.assert_array_equal(taken.of(signal), values)


BARE_TITLES = "time,A.dp [bar],A.n [rpm]\n"
WITH_QUALITY = "time,A.dp [bar],A.dp Quality,A.n [rpm]\n"
GERMAN = "time;A.dp [mbar];A.n [rpm]\n"
AMBIGUOUS = {
    "dates": (BARE_TITLES, "10/31/2026 23:0{},1.5,900\n", "11/01/2026 00:0{},1.5,900\n", 1.5e5),
    "qualities": (WITH_QUALITY, "{},1,192,900\n", "1{},1,0,900\n", np.nan),
    "thousands": (GERMAN, "{};1.820,5;900\n", "1{};1.820;900\n", 1.82e5),
}
"""Titles, a row of a first table, a row of the next one that alone could be read in two ways, and
the last reading in Pa."""


@pytest.mark.parametrize("anew", [False, True])
@pytest.mark.parametrize("name", AMBIGUOUS)
def test_the_next_file_is_read_as_the_first(
    name: str, anew: bool, tmp_path: Path, abc: Ruleset
) -> None:
    """If it has the same titles, also by a watch that is started anew in it."""
    head, first, then, last = AMBIGUOUS[name]
    path, taken = growing(tmp_path, abc, head + "".join(map(first.format, range(9))))
    assert len(taken.times) == 9
    os.replace(write(tmp_path, head + "".join(map(then.format, range(4))), "new.csv"), path)
    taken.until(lambda t: len(t.times) == 13)
    if anew:
        stored = json.loads(json.dumps(taken.source.position))  # type: ignore[attr-defined]
        taken.source.close()
        append(path, "".join(map(then.format, range(4, 8))))
        taken.source = GrowingFile(path, abc, stored)
        taken.until(lambda t: len(t.times) == 17)
    np.testing.assert_allclose(taken.of("A.dp")[-1], last)


def test_one_row_alone_says_little(tmp_path: Path, abc: Ruleset) -> None:
    """One number alone may count days or seconds: the second row shows which."""
    head, first, *_ = stamped(DATES["spreadsheet"]).splitlines(keepends=True)
    assert not growing(tmp_path, abc, head + first)[1].times
    seconds = "".join(f"{t},1,2\n" for t in (40000, 40001))
    assert growing(tmp_path, abc, "time,A.dp,A.n\n" + seconds)[1].times == [40000, 40001]


REFUSED = {
    "long": (long("tag,time,value", "{tag},{time},{value}"), {}),
    "in pairs": (beside("Time", "", time=True, before=True), {}),
    "readings that hold": (SHEET.text(), {"hold": "last"}),
    "dates of two readings": (BARE.filled("Timestamp", "3/4/2025 1:05").text(), {}),
    **{name: (FORMS[name], {}) for name in ("annotated, pivoted", "LabVIEW")},
}
REASONS = (
    "watch reads tables with a column|may be 3 April|this is (annotated|LabVIEW).*, not plain CSV"
)


@pytest.mark.parametrize("name", REFUSED)
def test_what_watch_cannot_follow_is_refused(name: str, tmp_path: Path, abc: Ruleset) -> None:
    text, form = REFUSED[name]
    ruleset = dataclasses.replace(abc, file=dataclasses.replace(abc.file, **form))
    with pytest.raises(RecordingRefused, match=REASONS):
        Taken(GrowingFile(write(tmp_path, text), ruleset)).take()


@pytest.mark.parametrize("way", ["renamed", "copied and cut", "replaced"])
def test_a_file_that_is_rotated_loses_no_row(way: str, tmp_path: Path, abc: Ruleset) -> None:
    """What was written before and, by a logger that has the old file open, after it is read."""
    path, taken = growing(tmp_path, abc, lines([0, 1, 2]))
    append(path, lines([3], header=False))
    if way == "renamed":
        path.rename(tmp_path / "x.csv.1")
        taken.take()
        append(tmp_path / "x.csv.1", lines([4], header=False))
    else:
        append(path, lines([4], header=False))
        taken.take()
    if way == "replaced":
        (tmp_path / "new").write_text(lines([5]))
        os.replace(tmp_path / "new", path)
    else:
        path.write_text(lines([5]))
    taken.until(lambda t: len(t.times) >= 6)
    append(path, lines([6], header=False))
    taken.until(lambda t: t.times == [0, 1, 2, 3, 4, 5, 6])
    assert ("gap" in taken.kinds()) == (way == "copied and cut")


def test_clocks_of_files(tmp_path: Path, abc: Ruleset) -> None:
    """Rows that are not later are left out and told. Seconds that begin at 0 in each file go on, as
    when a folder of them is diagnosed."""
    path, taken = growing(tmp_path, abc, lines([0, 1, 1, 5, 3, 4, 6]))
    append(path, lines([2, 7], header=False))
    assert taken.take().times == [0, 1, 5, 6, 7]
    text = "x.csv: 3 rows are not later than those before them (the first: not later than 1 s)"
    assert taken.reports[1] == ("clock", f"{text} and are left out")
    assert taken.kinds() == ["connected", "clock"]
    path, taken = growing(tmp_path, abc, lines([0, 2, 4]))
    path.rename(tmp_path / "x.csv.1")
    path.write_text(lines([0, 2]))
    taken.until(lambda t: t.times == [0, 2, 4, 6, 8])
    assert "clock" in taken.kinds()


def test_what_is_left_out_of_the_first_block_has_its_time(tmp_path: Path, abc: Ruleset) -> None:
    """Not that of the beginning of the calendar."""
    stamps = ("2026-03-01 11:00:00", "2026-03-01 11:00:01", "2026-03-01 10:00:02", "Bad")
    table = "time,A.dp [bar],A.n [rpm]\n" + "".join(f"{stamp},1,900\n" for stamp in stamps)
    zoned = dataclasses.replace(abc, time_zone="Europe/Berlin")
    _, taken = growing(tmp_path, zoned, table + "2026-03-01 11:00:02,1\n")
    taken.take()
    assert taken.kinds() == ["connected", "clock", "clock", "refused"]
    assert {notice.time for notice in taken.notices[1:]} == {taken.times[-1]}
    assert taken.reports[2][1] == (
        "x.csv: 1 row is not later than 2026-03-01 11:00:01 and is left out"
    )


def test_titles_that_a_logger_repeats_are_no_readings(tmp_path: Path, abc: Ruleset) -> None:
    """It was started again, and writes on into the same file."""
    path, taken = growing(tmp_path, abc, lines([0, 1]))
    append(path, lines([2, 3]))
    assert taken.take().times == [0, 1, 2, 3]
    assert taken.kinds() == ["connected"]
    assert not any("word" in note for note in read_recording(path, abc).notes)


def test_one_stamp_far_ahead_does_not_blind_the_watch(tmp_path: Path, abc: Ruleset) -> None:
    """A clock without dates goes on behind it; one with dates has no stamp of next year."""
    path, taken = growing(tmp_path, abc, lines([0, 1, 1e9]))
    for i in range(2, 40):
        append(path, lines([i], header=False))
        taken.take()
    assert len(taken.times) == 3 + 38 - limits.SET_BACK
    assert (np.diff(taken.times) > 0).all()
    dated = "time,A.dp [bar]\n2026-03-01 10:00,1\n2999-01-01,1\n2026-03-01 10:01,1\n"
    assert len(growing(tmp_path, abc, dated)[1].times) == 2


def test_what_is_odd_is_told_once(tmp_path: Path, abc: Ruleset) -> None:
    """Words, values beyond any sensor, broken rows, a line without end: a file of any length."""
    path, taken = growing(tmp_path, abc, lines([0]))
    for i in range(1, 4):
        append(path, f"{i},bad\x1b[31m,900\n{i}.2,1e300,9\n{i}.3,1\n{i}.4,{'9' * 1_500_000}\n")
        taken.until(lambda t, i=i: len(t.times) == 1 + 2 * i)  # type: ignore[misc]
    assert np.isnan(taken.of("A.dp")[1:]).all()
    assert taken.kinds() == ["connected", *["refused"] * 3]
    assert all(c.isprintable() for _, text in taken.reports for c in text)


def test_a_file_of_another_plant_is_refused(tmp_path: Path, abc: Ruleset) -> None:
    """At the start at once; behind a rotation it is told, and the next file is waited for."""
    bad = tmp_path / "bad.csv"
    for text, why in (("A.dp [bar],A.n [rpm]\n1,2\n", "no time column"), ("a\0b\n", "binary")):
        bad.write_text(text)
        with pytest.raises(RecordingRefused, match=why):
            GrowingFile(bad, abc)
    path, taken = growing(tmp_path, abc, lines([0, 1]))
    bad.write_text("time [s],A.dp [m]\n2,1\n")
    os.replace(bad, path)
    taken.until(lambda t: "refused" in t.kinds())
    assert "A.dp is measured in bar" in taken.reports[-1][1]
    bad.write_text(lines([3]))
    os.replace(bad, path)
    taken.until(lambda t: t.times == [0, 1, 3])


def test_silence_is_told_once(tmp_path: Path, abc: Ruleset, monkeypatch: Patch) -> None:
    """Rows that are left out are silence: a logger whose clock was set back writes on."""
    monkeypatch.setattr(limits, "STALE", 0.1)
    monkeypatch.setattr(limits, "STALE_STEPS", 0.1)
    day = "2026-03-01 {},1,900\n"
    head = "time,A.dp [bar],A.n [rpm]\n" + day.format("12:00:00")
    path, taken = growing(tmp_path, abc, head)
    taken.until(lambda t: "stale" in t.kinds()).take(0.2)
    append(path, day.format("12:00:01"))
    taken.until(lambda t: t.kinds()[-1] == "connected")
    for second in range(3):
        append(path, day.format(f"11:00:0{second}"))
        taken.take(0.1)
    taken.until(lambda t: t.kinds().count("stale") == 2)
    said = (
        r"x.csv: rows came, but for \d s none later than 2026-03-01 12:00:01; was the clock of .*\?"
    )
    assert re.fullmatch(said, next(text for kind, text in taken.reports[::-1] if kind == "stale"))
    path.unlink()
    taken.until(lambda t: "lost" in t.kinds())
    kinds = [kind for kind in taken.kinds() if kind != "clock"]
    assert kinds == ["connected", "stale", "connected", "stale", "lost"]
    assert "clock" in taken.kinds()
    path.write_text(head.replace("12:00:00", "12:00:02"))
    taken.until(lambda t: len(t.times) == 3)


def test_a_reader_is_killed_at_any_moment(tmp_path: Path, abc: Ruleset) -> None:
    """At any moment, while half lines come and files are rotated, also twice while nobody reads;
    rows count with the position that is stored with them. Files beside them are none of theirs; it
    is told that what was read is gone."""
    path, draw, written = tmp_path / "x.csv", random.Random(1), 0
    path.write_text(lines([]))
    (tmp_path / "x-2.csv").write_text(lines([0.5, 70.5, 3000]))
    os.utime(tmp_path / "x-2.csv", (4e9, 4e9))
    stored, times = GrowingFile(path, abc).position, list[float]()
    while written < 2500:
        taken = Taken(GrowingFile(path, abc, json.loads(json.dumps(stored))))
        kept = 0
        for _ in range(draw.randrange(1, 20)):
            upto = min(2500, written + draw.randrange(1, 60))
            text = lines(range(written, upto), header=False)
            half = draw.randrange(len(text) + 1)
            for piece in (text[:half], text[half:]):
                append(path, piece)
                taken.take()
                if draw.random() < 0.5:
                    kept, stored = len(taken.times), taken.source.position  # type: ignore[attr-defined]
            written = upto
        times += taken.times[:kept]
        taken.source.close()
        if draw.random() < 0.5:
            time.sleep(0.02)  # later files bear later times
            path.rename(tmp_path / f"x.csv.{written}")
            path.write_text(lines([]))
    last = Taken(GrowingFile(path, abc, stored))
    last.until(lambda t: [*times, *t.times][-1:] == [2499])
    assert [*times, *last.times] == list(range(2500))
    assert "gap" not in last.kinds()
    stored = last.source.position | {"inode": 1}  # type: ignore[attr-defined]
    assert Taken(GrowingFile(path, abc, stored)).take().kinds()[0] == "gap"


def test_standard_input_reads_a_pipe_to_its_end(abc: Ruleset) -> None:
    """A last row without an end of line counts, as in a file."""
    reading, writing = os.pipe()
    taken = Taken(StandardInput(abc, reading))
    os.write(writing, (lines([0, 1]) + "2,0.").encode())
    assert taken.take(1.0).times == [0, 1]
    assert taken.take(0.01).times == [0, 1]
    os.write(writing, b"02,900")
    os.close(writing)
    taken.until(lambda t: t.source.ended)
    os.close(reading)
    assert taken.times == [0, 1, 2]
    assert taken.kinds() == ["connected", "ended"]


def test_a_long_file_is_read_in_blocks(tmp_path: Path, abc: Ruleset) -> None:
    path = tmp_path / "x.csv"
    path.write_text(lines(range(30_000)))
    source = GrowingFile(path, abc)
    blocks = [p for _ in range(4) for p in source.take(0.0) if isinstance(p, Rows)]
    assert sum(len(b) for b in blocks) == 30_000
    assert len(blocks) > 1


def test_a_head_that_has_begun_is_waited_for(tmp_path: Path, abc: Ruleset) -> None:
    """Lines above the titles refuse nothing, nor do titles without a row; a unit of the wrong kind
    is refused, and a second row of words. Titles may be numbers."""
    at = len(head()) - len(UNITS) - 5
    path, taken = growing(tmp_path, abc, head()[:at])
    append(path, head()[at:-10])
    assert taken.take().notices == []
    append(path, head()[-10:] + rows(range(2)))
    assert taken.take().times == [0, 1]
    assert taken.of("A.dp") == pytest.approx([50.0, 150.0])
    missing = ", ".join(s.id for s in abc.signals if s.id in abc.read - {"A.dp", "A.n"})
    text = f"x.csv: 2 of {len(abc.read)} signals; without {missing}; "
    assert taken.reports == [("connected", text + "2 lines above the titles left out")]
    path.write_text("time,A.dp,A.n\ns,m3/h,rpm\n0,1,2\n")
    with pytest.raises(RecordingRefused, match="is measured in bar"):
        GrowingFile(path, abc)
    _, taken = growing(tmp_path, abc, "time,A.dp,A.n\ns,mbar,rpm\nraw,raw,raw\n0,1,2\n")
    assert taken.kinds() == ["refused"]
    begin = ["logger 7\n", "time,101,102\n"]
    assert title_line(begin, {"time"}, ended=False) is None
    found = title_line([*begin, "0,1,2\n"], {"time"}, ended=False)
    assert found is not None
    assert (found.number, found.separator, found.above) == (1, ",", 1)


def test_the_next_file_may_have_another_head(tmp_path: Path, abc: Ruleset) -> None:
    """Other lines above, another order, other units; titles without a row between them. Of two
    rotations at once none is left out, nor where a watch is started anew while only titles are
    there."""
    path, taken = growing(tmp_path, abc, head() + rows(range(2)))
    os.utime(path, (1000, 1000))
    path.rename(tmp_path / "x.csv.2")
    older = tmp_path / "x.csv.1"
    older.write_text("time,A.n,A.dp\ns,rpm,bar\n2,900,0.0025\n3,900,0.0035\n")
    os.utime(older, (2000, 2000))
    path.write_text(head("2026-03-03") + rows(range(4, 6)))
    taken.until(lambda t: len(t.times) == 6)
    path.rename(tmp_path / "x.csv.3")
    path.write_text(TITLES)
    taken.until(lambda t: t.source._table.head is None)  # type: ignore[attr-defined]
    stored = json.loads(json.dumps(taken.source.position))  # type: ignore[attr-defined]
    append(path, UNITS + rows(range(6, 8)))
    path.rename(tmp_path / "x.csv.4")
    path.write_text(TITLES)
    taken.source = GrowingFile(path, abc, stored)
    taken.until(lambda t: len(t.times) == 8 and t.source._table.head is None)  # type: ignore[attr-defined]
    path.rename(tmp_path / "x.csv.5")
    path.write_text("logger\nA.n,time,A.dp\nrpm,s,bar\n900,8,0.0085\n900,9,0.0095\n")
    taken.until(lambda t: len(t.times) == 10)
    assert taken.times == list(range(10))
    np.testing.assert_allclose(taken.of("A.dp"), 50 + 100 * np.arange(10))
    assert set(taken.kinds()) == {"connected"}


def test_zones_and_their_clocks(tmp_path: Path, abc: Ruleset) -> None:
    """An hour that the zone leaves out is told; one that is unknown here matters to dates alone."""
    zoned, text = dataclasses.replace(abc, time_zone="Europe/Berlin"), "time,A.dp [bar],A.n [rpm]\n"
    _, taken = growing(tmp_path, zoned, text + "2025-03-30 02:30:00,1,900\n")
    told = "x.csv: 1 row is in the hour that Europe/Berlin leaves out; is the zone right?"
    assert ("clock", told) in taken.reports
    unknown = dataclasses.replace(abc, time_zone="Nowhere/Else")
    assert growing(tmp_path, unknown, lines([0, 1]))[1].times == [0, 1]
