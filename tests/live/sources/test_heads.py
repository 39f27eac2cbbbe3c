"""Heads of files that grow: lines above the titles, units below them, dates of a named zone."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.growing_file import GrowingFile
from rulec_runtime.live.sources.standard_input import StandardInput
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.recordings.titles import TitleSearch

from tests.live.sources.taking import Taken, append, growing, lines

ABOVE = "Station 4;begun {}\nrate [Hz];1\n"
TITLES = "Zeit;A.dp;A.n\n"
UNITS = "ms;[mbar];1/min\n"
HEAD = ABOVE.format("2026-03-01") + TITLES + UNITS


def rows(times: range, text: str = "{:d};{},5;900\n") -> str:
    return "".join(text.format(1000 * t, t) for t in times)


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "LINGER", 0.02)


class Pipe:
    """Standard input, and what writes to it."""

    def __init__(self, abc: Ruleset) -> None:
        reading, self.writing = os.pipe()
        self.taken = Taken(StandardInput(abc, reading))

    def append(self, text: str) -> None:
        os.write(self.writing, text.encode())

    def end(self) -> None:
        os.close(self.writing)
        self.taken.until(lambda t: t.source.ended)


@pytest.mark.parametrize("source", ["file", "pipe"])
def test_a_head_in_pieces_reads_as_the_whole_recording(
    source: str, tmp_path: Path, abc: Ruleset
) -> None:
    """Lines above the titles are left out, units below them count, wherever a piece ends."""
    text = HEAD + rows(range(30))
    whole, grown = tmp_path / "whole.csv", tmp_path / "grown.csv"
    whole.write_text(text, encoding="utf-8")
    grown.touch()
    pipe = Pipe(abc)
    taken = Taken(GrowingFile(grown, abc)) if source == "file" else pipe.taken
    write: Callable[[str], None] = pipe.append if source == "pipe" else lambda t: append(grown, t)
    for at in range(0, len(text), 7):
        write(text[at : at + 7])
        taken.take()
    pipe.end()
    expected = read_recording(whole, abc)
    assert taken.times == list(range(30))
    np.testing.assert_allclose(taken.of("A.dp")[:2], [50.0, 150.0])
    for name, values in expected.values.items():
        np.testing.assert_array_equal(taken.of(name), values)
    name = "grown.csv" if source == "file" else "standard input"
    missing = ", ".join(s.id for s in abc.signals if s.id in abc.read - set(expected.values))
    told = f"{name}: 2 of {len(abc.read)} signals; without {missing}; "
    assert taken.told[0] == ("connected", told + "2 lines above the titles left out")


def test_units_below_are_those_of_the_file(tmp_path: Path, abc: Ruleset) -> None:
    """A unit of the wrong kind is refused, and a second row of words."""
    path = tmp_path / "x.csv"
    path.write_text("time,A.dp,A.n\ns,m3/h,rpm\n0,1,2\n")
    with pytest.raises(RecordingRefused, match="is measured in bar"):
        GrowingFile(path, abc)
    path.write_text("time,A.dp,A.n\ns,mbar,rpm\nraw,raw,raw\n0,1,2\n")
    taken = Taken(GrowingFile(path, abc)).take()
    assert taken.kinds() == ["refused"]


def test_a_head_that_has_begun_is_waited_for(tmp_path: Path, abc: Ruleset) -> None:
    """Lines above the titles refuse nothing, nor do titles without a row."""
    path, taken = growing(tmp_path, abc, ABOVE.format("2026-03-01") + TITLES[:9])
    append(path, TITLES[9:] + UNITS[:4])
    assert taken.take().notices == []
    append(path, UNITS[4:] + rows(range(2)))
    assert taken.take().times == [0, 1]


def test_a_watch_is_started_anew_while_only_titles_are_there(tmp_path: Path, abc: Ruleset) -> None:
    """The file is renamed meanwhile, and none of its rows is lost."""
    path = tmp_path / "x.csv"
    path.write_text(ABOVE.format("2026-03-01") + TITLES)
    first = GrowingFile(path, abc)
    Taken(first).take()
    stored = json.loads(json.dumps(first.position))
    append(path, UNITS + rows(range(2)))
    path.rename(tmp_path / "x.csv.1")
    path.write_text(HEAD + rows(range(2, 4)))
    second = Taken(GrowingFile(path, abc, stored))
    assert second.until(lambda t: len(t.times) >= 4).times == [0, 1, 2, 3]
    assert "gap" not in second.kinds()
    stored = second.source.position  # type: ignore[attr-defined]
    append(path, rows(range(4, 5)))
    assert Taken(GrowingFile(path, abc, stored)).take().times == [4]


def test_the_next_file_may_have_another_head(tmp_path: Path, abc: Ruleset) -> None:
    """Other lines above, another order, other units; titles without a row between them."""
    path, taken = growing(tmp_path, abc, HEAD + rows(range(2)))
    path.rename(tmp_path / "x.csv.1")
    path.write_text(TITLES)
    taken.until(lambda t: t.source._head is None)  # type: ignore[attr-defined]
    path.rename(tmp_path / "x.csv.2")
    path.write_text("logger\nA.n,time,A.dp\nrpm,s,bar\n900,2,0.0025\n900,3,0.0035\n")
    taken.until(lambda t: len(t.times) == 4)
    assert taken.times == [0, 1, 2, 3]
    np.testing.assert_allclose(taken.of("A.dp"), [50, 150, 250, 350])
    assert taken.kinds() == ["connected", "connected"]


def test_lines_above_do_not_tell_files_apart(tmp_path: Path, abc: Ruleset) -> None:
    """Of two rotations at once none is left out, though each head says when it was begun."""
    path = tmp_path / "x.csv"
    path.write_text(HEAD + rows(range(2)))
    os.utime(path, (1000, 1000))
    taken = Taken(GrowingFile(path, abc)).take()
    path.rename(tmp_path / "x.csv.2")
    older = tmp_path / "x.csv.1"
    older.write_text(ABOVE.format("2026-03-02") + TITLES + UNITS + rows(range(2, 4)))
    os.utime(older, (2000, 2000))
    path.write_text(ABOVE.format("2026-03-03") + TITLES + UNITS + rows(range(4, 6)))
    assert taken.until(lambda t: len(t.times) >= 6).times == list(range(6))


@pytest.mark.parametrize("restarts", [False, True])
def test_dates_of_a_named_zone(restarts: bool, tmp_path: Path, abc: Ruleset) -> None:
    """The hour that is shown twice in autumn is read as two, row by row, also by a watch that is
    started anew in each of them."""
    zoned = dataclasses.replace(abc, time_zone="Europe/Berlin")
    utc = [np.datetime64("2025-10-26T00:00:00") + np.timedelta64(10 * k, "m") for k in range(15)]
    summer = np.datetime64("2025-10-26T01:00:00")
    wall = [d + np.timedelta64(2 if d < summer else 1, "h") for d in utc]
    seconds = [float(d.astype("datetime64[s]").astype(float)) for d in utc]
    path = tmp_path / "x.csv"
    path.write_text("time,A.dp [bar],A.n [rpm]\n")
    source, times = GrowingFile(path, zoned), []
    for date in wall:
        append(path, f"{date},1,900\n")
        taken = Taken(source).take()
        assert taken.kinds() in ([], ["connected"])
        times += taken.times
        if restarts:
            source = GrowingFile(path, zoned, json.loads(json.dumps(source.position)))
    assert times == seconds
    assert source.dated


def test_an_hour_that_the_zone_leaves_out_is_told(tmp_path: Path, abc: Ruleset) -> None:
    zoned = dataclasses.replace(abc, time_zone="Europe/Berlin")
    path = tmp_path / "x.csv"
    path.write_text("time,A.dp [bar],A.n [rpm]\n2025-03-30 02:30:00,1,900\n")
    taken = Taken(GrowingFile(path, zoned)).take()
    text = "x.csv: 1 row is in the hour that Europe/Berlin leaves out; is the zone right?"
    assert ("clock", text) in taken.told
    path.write_text(lines([0, 1]))
    unknown = dataclasses.replace(abc, time_zone="Nowhere/Else")
    assert Taken(GrowingFile(path, unknown)).take().times == [0, 1]


def test_titles_may_be_numbers() -> None:
    """Channels of a logger: rows of numbers below say that they are no readings."""
    search = TitleSearch({"time"})
    assert [search.add(line) for line in ("logger 7\n", "time,101,102\n")] == [None, None]
    found = search.add("0,1,2\n")
    assert found is not None
    assert (found.number, found.separator, found.above) == (1, ",", 1)
