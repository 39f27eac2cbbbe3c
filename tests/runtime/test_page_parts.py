"""Parts of pages: axes of dates, the sketch of a plant, when a page was made."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Junction, Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.recordings.wall_clock import Calendar
from rulec_runtime.recordings.when import course
from rulec_runtime.report.made import EPOCH, made_now
from rulec_runtime.report.sketch import MOST, sketch, topology_of
from rulec_runtime.report.time_axis import Dated, named, time_axis

from rulec.cli import main
from tests.conftest import ROOT, compiled
from tests.runtime.sheets import Sheet, example, write

DAY = 86400.0
NOON = 1790078400.0
"""2026-09-22 12:00 UTC."""


@pytest.mark.parametrize(
    ("length", "first", "step"),
    [
        (30.0, "12:00:00", 5.0),
        (3000.0, "12:00", 600.0),
        (DAY, "12:00", 21600.0),
        (10 * DAY, "2026-09-24", 2 * DAY),
        (100 * DAY, "2026-09-24", 14 * DAY),
    ],
)
def test_dates_have_sensible_steps(length: float, first: str, step: float) -> None:
    found = time_axis(0.0, length, Calendar(NOON))
    assert isinstance(found, Dated)
    assert first == found.labels()[0]
    assert step == found.ticks[1] - found.ticks[0]
    assert 3 <= len(found.ticks) <= 9


def test_years_are_counted_in_months() -> None:
    found = time_axis(0.0, 700 * DAY, Calendar(NOON))
    assert ["2027-01", "2027-07", "2028-01", "2028-07"] == [
        label for label in found.labels() if label[-2:] in ("01", "07")
    ]


def test_days_begin_at_midnight_on_both_sides_of_a_change_of_clocks() -> None:
    """In the night of 2026-10-25 clocks are set back."""
    start = 1792800000.0 - 7200.0
    change = 1792890000.0 - start
    calendar = Calendar(start, ((0.0, 7200.0), (change, 3600.0)))
    found = time_axis(0.0, 5 * DAY, calendar)
    assert {(0, 0)} == {(calendar.at(t).hour, calendar.at(t).minute) for t in found.ticks}
    assert 25 * 3600.0 in {b - a for a, b in zip(found.ticks, found.ticks[1:], strict=False)}


def test_without_dates_the_unit_follows_the_length() -> None:
    names = [named(time_axis(0.0, length, None), None) for length in (80.0, 3600.0, 2 * DAY)]
    assert ["time [s]", "time [min]", "time [h]"] == names


def test_layers_run_with_the_flow_and_loops_run_back() -> None:
    """A recirculating line comes back below."""
    found = topology_of(
        "ABCD", [Junction(("A", "D"), ("B",)), Junction(("B",), ("C",)), Junction(("C",), ("D",))]
    )
    assert ((3, 1),) == found.back
    assert [(0,), (1,), (2,), (3,)] == [tuple(sorted(layer)) for layer in found.layers]


def test_many_modules_are_folded_and_what_is_marked_is_drawn() -> None:
    names = [f"P{i}" for i in range(200)] + ["channel"]
    pipes = [Junction(tuple(names[:-1]), ("channel",))]
    found = topology_of(names, pipes, ["P150"])
    alone = [box[0] for box in found.boxes if len(box) == 1]
    assert MOST == len(alone)
    assert {"P150", "channel"} <= set(alone)
    assert [201 - MOST] == [len(box) for box in found.boxes if len(box) > 1]
    chain = [Junction((f"P{i}",), (f"P{i + 1}",)) for i in range(199)]
    middle = topology_of(names[:-1], chain, ["P100"])
    assert 2 == sum(len(box) > 1 for box in middle.boxes)


def test_sketch_of_hostile_names_is_sound(abc: Ruleset) -> None:
    """Names stay text; colour and symbol mark what was found; words say the same."""
    bad = "<script>'\"&\x07"
    ruleset = dataclasses.replace(
        abc,
        modules={bad: bad, "B": "b", "C": bad * 40},
        junctions=(Junction((bad, "B"), ("C",)),),
    )
    drawn = ET.fromstring(sketch(ruleset, {bad: "F", "gone": "F"}))
    assert [] == list(drawn.iter("script"))
    svg = drawn.find(".//svg")
    assert svg is not None
    assert "✖ F here" in (svg.get("aria-label") or "")
    assert "box is-F" in [g.get("class") for g in drawn.iter("g")]


def test_a_plant_that_stores_is_drawn_with_its_pipes() -> None:
    """No flows balance at its tanks, and yet they are connected."""
    ruleset = compiled("cascaded-tanks")
    assert () == ruleset.junctions
    found = topology_of(ruleset.modules, ruleset.unbalanced)
    assert ((0, 1), (1, 2)) == found.pipes


def test_the_time_can_be_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """For those who want the same bytes again."""
    monkeypatch.setenv(EPOCH, "1790078400")
    assert "2026-09-22 12:00 UTC" == made_now("rulec-runtime").when
    assert "nothing-of-that-name" == made_now("nothing-of-that-name").tool


def test_a_matrix_has_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All residuals and faults, a row per reading, and each group of faults that are alike."""
    file = tmp_path / "matrix.html"
    assert 0 == main(["matrix", str(ROOT / "plants" / "abc"), "--report", str(file)])
    assert "matrix.html" in capsys.readouterr().out.replace("\n", "")
    page, abc = ET.fromstring(file.read_text(encoding="utf-8")), compiled("abc")
    rows = page.findall(".//table[@class='matrix']/tbody/tr")
    names = [*(f.id for f in abc.faults), *abc.moved_by_reading]
    assert names == [row.findtext("th") for row in rows]
    assert len(abc.ambiguous) == len(page.findall(".//dt/b[@class='alike']"))


LEAK = example("leakage_A")


def moving_end(sheet: Sheet) -> Sheet:
    """The leakage of 51 s lasts, and from 58 s on every speed ramps."""
    rows = sheet.rows[:58]
    last = rows[-1]
    columns = [i for i, title in enumerate(sheet.header) if ".n [" in title]
    more = []
    for k in range(1, 13):
        cells = list(last)
        cells[0] = str(57 + k)
        for i in columns:
            cells[i] = str(float(last[i]) - 40.0 * k)
        more.append(tuple(cells))
    return replace(sheet, rows=(*rows, *more))


@pytest.mark.parametrize(
    ("sheet", "behind"),
    [
        (LEAK, None),
        (replace(LEAK, rows=LEAK.rows[:58]), ""),
        (moving_end(LEAK), "not judged"),
    ],
)
def test_what_follows_a_fault_is_said(
    sheet: Sheet, behind: str | None, tmp_path: Path, abc: Ruleset
) -> None:
    """A fault that ends, one that lasts to the end, one behind which nothing is settled."""
    found = diagnose(read_recording(write(tmp_path, sheet.text()), abc), abc)
    last = [f for f in found.findings if f.since == 51.0][-1]
    assert (behind, behind is not None) == (last.behind, last.active)
    text = course(None, last.since, last.until, last.behind)
    assert ("still active" in text) == last.active
    assert ("not settled" in text) == (behind == "not settled")
