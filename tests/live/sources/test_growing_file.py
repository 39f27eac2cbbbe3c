"""Files that grow, are rotated, cut and left by a process that was killed."""

from __future__ import annotations

import json
import os
import random
import time
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.growing_file import GrowingFile
from rulec_runtime.live.sources.standard_input import StandardInput
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.recording import read_recording

from tests.conftest import ROOT
from tests.live.sources.taking import Taken, append, growing, lines

EXAMPLE = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "LINGER", 0.05)


def dialects() -> dict[str, bytes]:
    plain = EXAMPLE.read_text(encoding="utf-8")
    german = plain.replace(",", ";").replace(".", ",").replace("A,", "A.").replace("B,", "B.")
    german = german.replace("C,", "C.").replace("degC", "°C")
    dated = "\n".join(
        line if i == 0 else f"2026-03-01 10:00:{i:02d}+01:00,{line.split(',', 1)[1]}"
        for i, line in enumerate(plain.splitlines()[:50])
    )
    return {
        "plain": plain.encode(),
        "CRLF": plain.replace("\n", "\r\n").encode(),
        "German, Latin-1": german.encode("latin-1"),
        "sep= and remarks": ("\ufeffsep=;\n# by a logger\n\n" + german).encode(),
        "UTF-16": plain.encode("utf-16"),
        "UTF-16 big": "\ufeff".encode("utf-16-be") + plain.encode("utf-16-be"),
        "dated": (dated + "\n").encode(),
    }


@pytest.mark.parametrize("dialect", dialects())
def test_a_growing_file_reads_as_the_whole_recording(
    dialect: str, tmp_path: Path, abc: Ruleset
) -> None:
    """Whatever its pieces, byte by byte even, rows are those of `rulec diagnose`."""
    data = dialects()[dialect]
    whole, grown = tmp_path / "whole.csv", tmp_path / "grown.csv"
    whole.write_bytes(data)
    grown.touch()
    taken = Taken(GrowingFile(grown, abc))
    at, draw = 0, random.Random(dialect)
    while at < len(data):
        step = draw.choice((1, 3, 40, 700))
        append(grown, data[at : at + step])
        at += step
        taken.take()
    taken.take()
    expected = read_recording(whole, abc)
    times = np.array(taken.times)
    assert taken.source.dated == (dialect == "dated")
    np.testing.assert_array_equal(times - (times[0] if dialect == "dated" else 0), expected.time)
    for name, values in expected.values.items():
        np.testing.assert_array_equal(taken.of(name), values)
    assert taken.kinds() == ["connected"]


def test_half_a_line_waits_for_its_end(tmp_path: Path, abc: Ruleset) -> None:
    path = tmp_path / "x.csv"
    path.write_text(lines([0, 1]) + "2,0.")
    taken = Taken(GrowingFile(path, abc)).take().take()
    assert taken.times == [0, 1]
    append(path, "02,900\n")
    assert taken.take().of("A.dp") == [0, 1000, 2000]


@pytest.mark.parametrize("way", ["renamed", "copied and cut", "replaced"])
def test_a_file_that_is_rotated_loses_no_row(way: str, tmp_path: Path, abc: Ruleset) -> None:
    """What was written before and, by a logger that has the old file open, after it is read."""
    path, taken = growing(tmp_path, abc, lines([0, 1, 2]))
    append(path, lines([3], header=False))
    if way == "renamed":
        path.rename(tmp_path / "x.csv.1")
        taken.take()
        append(tmp_path / "x.csv.1", lines([4], header=False))
        path.write_text(lines([5]))
    elif way == "replaced":
        append(path, lines([4], header=False))
        (tmp_path / "new").write_text(lines([5]))
        taken.take()
        os.replace(tmp_path / "new", path)
    else:
        append(path, lines([4], header=False))
        taken.take()
        path.write_text(lines([5]))
    taken.until(lambda t: len(t.times) >= 6)
    append(path, lines([6], header=False))
    taken.until(lambda t: t.times == [0, 1, 2, 3, 4, 5, 6])
    assert ("gap" in taken.kinds()) == (way == "copied and cut")


def test_a_clock_that_begins_anew_goes_on(tmp_path: Path, abc: Ruleset) -> None:
    """Plain seconds that begin at 0 in each file, as when a folder of them is diagnosed."""
    path, taken = growing(tmp_path, abc, lines([0, 2, 4]))
    path.rename(tmp_path / "x.csv.1")
    path.write_text(lines([0, 2]))
    taken.until(lambda t: t.times == [0, 2, 4, 6, 8])
    assert "clock" in taken.kinds()


def test_rows_that_are_not_later_are_left_out_and_told(tmp_path: Path, abc: Ruleset) -> None:
    path, taken = growing(tmp_path, abc, lines([0, 1, 1, 5, 3, 4, 6]))
    append(path, lines([2, 7], header=False))
    assert taken.take().times == [0, 1, 5, 6, 7]
    assert taken.told[1] == ("clock", "x.csv: 3 rows are not later than 6 s and are left out")
    assert taken.kinds() == ["connected", "clock"]


def test_one_stamp_far_ahead_does_not_blind_the_watch(tmp_path: Path, abc: Ruleset) -> None:
    """A clock without dates goes on behind it; one with dates has no stamp of next year."""
    path, taken = growing(tmp_path, abc, lines([0, 1, 1e9]))
    for i in range(2, 40):
        append(path, lines([i], header=False))
        taken.take()
    assert len(taken.times) == 3 + 38 - limits.SET_BACK
    assert (np.diff(taken.times) > 0).all()
    dated = tmp_path / "dated.csv"
    dated.write_text("time,A.dp [bar]\n2026-03-01 10:00,1\n2999-01-01,1\n2026-03-01 10:01,1\n")
    assert len(Taken(GrowingFile(dated, abc)).take().times) == 2


def test_what_is_odd_is_told_once(tmp_path: Path, abc: Ruleset) -> None:
    """Words, values beyond any sensor, broken rows, a line without end: a file of any length."""
    path, taken = growing(tmp_path, abc, lines([0]))
    for i in range(1, 4):
        append(path, f"{i},bad\x1b[31m,900\n{i}.2,1e300,9\n{i}.3,1\n{i}.4,{'9' * 1_500_000}\n")
        taken.until(lambda t, i=i: len(t.times) == 1 + 2 * i)  # type: ignore[misc]
    assert np.isnan(taken.of("A.dp")[1:]).all()
    assert taken.kinds() == ["connected", *["refused"] * 4]
    assert all(c.isprintable() for _, text in taken.told for c in text)


def test_a_file_of_another_plant_is_refused(tmp_path: Path, abc: Ruleset) -> None:
    """At the start at once; behind a rotation it is told, and the next file is waited for."""
    bad = tmp_path / "bad.csv"
    for text, why in (
        ("time [s],X.dp [bar]\n", "no column belongs to this plant"),
        ("A.dp [bar],A.n [rpm]\n1,2\n", "there is no time column"),
        ("time [s],A.dp [parrots]\n0,1\n", "unknown unit"),
        ("a\0b\n", "binary file"),
    ):
        bad.write_text(text)
        with pytest.raises(RecordingRefused, match=why):
            GrowingFile(bad, abc)
    with pytest.raises(RecordingRefused, match="no such file"):
        GrowingFile(tmp_path / "none.csv", abc)
    path, taken = growing(tmp_path, abc, lines([0, 1]))
    bad.write_text("time [s],A.dp [m]\n2,1\n")
    os.replace(bad, path)
    taken.until(lambda t: "refused" in t.kinds())
    assert "A.dp is measured in bar" in taken.told[-1][1]
    bad.write_text(lines([3]))
    os.replace(bad, path)
    taken.until(lambda t: t.times == [0, 1, 3])


def test_silence_is_told_once_until_rows_come_again(
    tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "STALE", 0.1)
    monkeypatch.setattr(limits, "STALE_STEPS", 0.1)
    path, taken = growing(tmp_path, abc, lines([0, 1]))
    taken.until(lambda t: "stale" in t.kinds()).take(0.2)
    append(path, lines([2], header=False))
    taken.until(lambda t: t.kinds().count("stale") == 2)
    path.unlink()
    taken.until(lambda t: "lost" in t.kinds())
    assert taken.kinds() == ["connected", "stale", "connected", "stale", "lost"]
    path.write_text(lines([3]))
    taken.until(lambda t: t.times == [0, 1, 2, 3])


def test_rows_that_are_left_out_are_silence(
    tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A logger whose clock was set back writes on, and nothing of it can be judged."""
    monkeypatch.setattr(limits, "STALE", 0.1)
    monkeypatch.setattr(limits, "STALE_STEPS", 0.1)
    path, taken = growing(tmp_path, abc, "time,A.dp [bar],A.n [rpm]\n2026-03-01 12:00:00,1,900\n")
    for second in range(3):
        append(path, f"2026-03-01 11:00:0{second},1,900\n")
        taken.take(0.1)
    taken.until(lambda t: "stale" in t.kinds())
    append(path, "2026-03-01 12:00:01,1,900\n")
    taken.until(lambda t: len(t.times) == 2)
    assert taken.kinds() == ["connected", "clock", "stale", "connected"]


def test_reading_goes_on_where_it_was_stored(tmp_path: Path, abc: Ruleset) -> None:
    """Also where the file was rotated twice meanwhile, behind half a line, or is gone."""
    path = tmp_path / "x.csv"
    path.write_text(lines([0, 1]) + "2,0.0")
    first = GrowingFile(path, abc)
    assert Taken(first).take().times == [0, 1]
    stored = json.loads(json.dumps(first.position))
    first.close()
    append(path, "2,900\n")
    os.utime(path, (1000, 1000))
    path.rename(tmp_path / "x.csv.2")
    (tmp_path / "x.csv.1").write_text(lines([3, 4]))
    os.utime(tmp_path / "x.csv.1", (2000, 2000))
    (tmp_path / "x-2.csv").write_text(lines([4.5]))
    path.write_text(lines([5]))
    second = Taken(GrowingFile(path, abc, stored))
    second.until(lambda t: t.times == [2, 3, 4, 5])
    assert "gap" not in second.kinds()
    stored = GrowingFile(path, abc, stored).position | {"inode": 1}
    third = Taken(GrowingFile(path, abc, stored)).take()
    assert third.kinds()[0] == "gap"


def test_a_reader_that_is_killed_reads_nothing_twice_and_loses_nothing(
    tmp_path: Path, abc: Ruleset
) -> None:
    """At any moment, while half lines come and files are rotated; rows count with the position
    that is stored with them."""
    path, draw, written = tmp_path / "x.csv", random.Random(1), 0
    path.write_text(lines([]))
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
