"""Pages: axes, thinned curves, the sketch of a plant, truth, courses; all in a real browser."""

import dataclasses
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rulec_runtime.contract.ruleset import Junction, Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.plant_calendar import Calendar, course
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.report.chart import axis
from rulec_runtime.report.page_origin import EPOCH
from rulec_runtime.report.sketch import MOST, layers_of, sketch, topology_of
from rulec_runtime.report.thin_curves import COLUMNS, thin_series
from rulec_runtime.report.time_axis import time_axis
from rulec_runtime.report.truth import cases_of, read_truth
from rulec_runtime.report.verdict import verdict

from rulec.cli import main
from rulec.commands.matrix import matrix_page, show
from rulec.commands.matrix import verdict as matrix_verdict
from rulec.commands.study_result import StudyResult
from rulec.mismatch.answer.terminal_and_page import verdict as mismatch_verdict
from rulec.mismatch.experiment.recipe import experiment_page
from rulec.prove.page import headline as prove_headline
from rulec.prove.page import page as prove_page
from rulec.prove.scores import table
from rulec.study.campaign import Settings
from rulec.study.points import Points
from rulec.study.summary import verdict as study_verdict
from tests.conftest import ROOT, Capsys, compiled
from tests.live.view.browser import CHROMIUM, Browser, browser
from tests.live.view.test_browser import CONTRAST
from tests.prove.made import run
from tests.runtime.mismatches import ALL, made_by_hand
from tests.runtime.reports import EXAMPLES, MADE, Judged, dated, judge, mismatch_page, shown
from tests.runtime.sheets import Sheet, example, write
from tests.test_study import TYPES, counted

DAY = 86400.0
NOON = 1790078400.0
"""2026-09-22 12:00 UTC."""


@pytest.mark.parametrize(
    ("length", "first", "step"),
    [
        (30.0, "12:00:00", 5.0),
        (DAY, "12:00", 21600.0),
        (10 * DAY, "2026-09-24", 2 * DAY),
        (700 * DAY, "2026-10-22", 91 * DAY),
    ],
)
def test_dates_have_sensible_steps(length: float, first: str, step: float) -> None:
    """Seconds to years; midnights on both sides of the night in which clocks are set back."""
    found = time_axis(0.0, length, Calendar(NOON))
    assert first == found.labels()[0]
    assert step == found.ticks[1] - found.ticks[0]
    assert 3 <= len(found.ticks) <= 9
    start = 1792800000.0 - 7200.0
    calendar = Calendar(start, ((0.0, 7200.0), (1792890000.0 - start, 3600.0)))
    days = time_axis(0.0, 5 * DAY, calendar).ticks
    assert {(0, 0)} == {(calendar.at(t).hour, calendar.at(t).minute) for t in days}
    assert 25 * 3600.0 in np.diff(days)


@settings(max_examples=50, deadline=None)
@given(st.floats(-1e6, 1e6), st.floats(0, 1e6), st.integers(2, 9))
def test_axes_have_sensible_ticks(low: float, span: float, wanted: int) -> None:
    scale = axis(low, low + span, wanted)
    assert scale.low <= scale.ticks[0]
    assert scale.ticks[-1] <= scale.high
    assert 1 <= len(scale.ticks) <= 2 * wanted + 1
    assert len(scale.ticks) == len(set(scale.labels()))


@settings(max_examples=30)
@given(st.lists(st.floats(-1e3, 1e3) | st.just(float("nan")), min_size=1, max_size=4000))
def test_thin_series_keeps_the_extremes(values: list[float]) -> None:
    time, series = np.arange(float(len(values))), np.array(values)
    _, thin = thin_series(time, series)
    assert len(thin) <= 2 * COLUMNS
    if np.isfinite(series).any():
        assert (np.nanmin(series), np.nanmax(series)) == (np.nanmin(thin), np.nanmax(thin))


def test_layers_run_with_the_flow_and_loops_run_back(abc: Ruleset) -> None:
    """At tanks no flows balance, and yet they are connected."""
    boxes, pipes = topology_of(
        "ABCD", [Junction(("A", "D"), ("B",)), Junction(("B",), ("C",)), Junction(("C",), ("D",))]
    )
    assert [[0], [1], [2], [3]] == layers_of(len(boxes), pipes)
    assert (3, 1) in pipes
    assert [[1], [0, 2], [3]] == layers_of(4, [(0, 3), (1, 2), (2, 3)])
    tanks = compiled("cascaded-tanks")
    assert () == tanks.junctions
    assert [(0, 1), (1, 2)] == topology_of(tanks.modules, tanks.unbalanced)[1]


def test_many_modules_are_folded_and_what_is_marked_is_drawn() -> None:
    names = [f"P{i}" for i in range(200)] + ["channel"]
    boxes, _ = topology_of(names, [Junction(tuple(names[:-1]), ("channel",))], ["P150"])
    alone = [box[0] for box in boxes if len(box) == 1]
    assert MOST == len(alone)
    assert {"P150", "channel"} <= set(alone)
    assert [201 - MOST] == [len(box) for box in boxes if len(box) > 1]
    chain = [Junction((f"P{i}",), (f"P{i + 1}",)) for i in range(199)]
    middle, _ = topology_of(names[:-1], chain, ["P100"])
    assert 2 == sum(len(box) > 1 for box in middle)


def test_sketch_of_hostile_names_is_sound(abc: Ruleset) -> None:
    bad = "<script>'\"&\x07"
    ruleset = dataclasses.replace(
        abc,
        modules={bad: bad, "B": "b", "C": bad * 40},
        junctions=(Junction((bad, "B"), ("C",)),),
    )
    drawn = ET.fromstring(sketch(ruleset, {bad: "F", "gone": "F"}))
    assert [] == list(drawn.iter("script"))
    svg = drawn.find(".//svg")
    assert "✖ F here" in (svg.get("aria-label") or "")
    assert "box is-F" in [g.get("class") for g in drawn.iter("g")]


def test_flows_of_a_station_are_told_in_its_unit() -> None:
    """On the page as on the terminal, in evidence and pictures; of a rig in l/h."""
    plant = ROOT / "plants" / "cooling-loop"
    page = judge(plant / "examples" / "fouling.csv", compiled("cooling-loop")).page()
    for part in ("differ by [m3/h]", "flow [m3/h]", "HX.transfer-flow [m3/h]"):
        assert part in page
    assert "l/h]" not in page


def test_a_matrix_cuts_no_name() -> None:
    """However long the names of modules, faults and observers, and however narrow the terminal."""
    for plant in ("cooling-loop", "irrigation-booster", "hsy-pumping"):
        assert "…" not in shown(show, compiled(plant), 80)


def test_a_matrix_has_a_page(
    tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time can be given, for those who want the same bytes again."""
    monkeypatch.setenv(EPOCH, "1790078400")
    file = tmp_path / "matrix.html"
    assert 0 == main(["matrix", str(ROOT / "plants" / "abc"), "--report", str(file)])
    assert "matrix.html" in capsys.readouterr().out.replace("\n", "")
    text = file.read_text(encoding="utf-8")
    assert "2026-09-22 12:00 UTC" in text
    groups = ET.fromstring(text).findall(".//dt/b[@class='alike']")
    assert len(compiled("abc").ambiguous) == len(groups)


LEAK = example("leakage_A")


def moving_end(sheet: Sheet) -> Sheet:
    """The leakage of 51 s lasts, and from 58 s on every speed ramps."""
    table = dataclasses.replace(sheet, rows=(*sheet.rows[:58], *[sheet.rows[57]] * 12))
    table = table.mapped("time", lambda k, _: str(k))
    for name in ("A.n", "B.n"):
        table = table.mapped(name, lambda k, cell: str(float(cell) - 40.0 * max(k - 57, 0)))
    return table


@pytest.mark.parametrize(
    ("sheet", "behind"),
    [
        (LEAK, None),
        (dataclasses.replace(LEAK, rows=LEAK.rows[:58]), ""),
        (moving_end(LEAK), "not judged"),
    ],
)
def test_what_follows_a_fault_is_said(
    sheet: Sheet, behind: str | None, tmp_path: Path, abc: Ruleset
) -> None:
    found = diagnose(read_recording(write(tmp_path, sheet.text()), abc), abc)
    last = [f for f in found.findings if f.since == 51.0][-1]
    assert (behind, behind is not None) == (last.behind, last.active)
    text = course(None, last.since, last.until, last.behind)
    assert ("still active" in text) == last.active
    assert ("not settled" in text) == (behind == "not settled")


@pytest.mark.parametrize(
    ("word", "faults", "named"),
    [
        ("A.leakage", {"A.leakage": 0.4, "C.clogging": 0.2}, True),
        ("C.clogging + A.leakage", {"A.leakage": 0.4, "C.clogging": 0.2}, True),
        ("C.clogging", {"A.leakage": 0.4, "C.clogging": 0.2}, False),
        ("C.clogging + A.leakage", {"A.leakage": 0.4}, False),
        ("A.leakage + unknown", {"A.leakage": 0.4}, False),
        ("C.clogging + A.leakage", {"A.leakage": 0.0}, False),
        ("ok", {"A.leakage": 0.0}, True),
    ],
)
def test_several_faults_at_once(
    word: str, faults: dict[str, float], named: bool, leaking: Judged
) -> None:
    n = len(leaking.trace.time)
    degree = np.array([np.full(n, x) for x in faults.values()])
    truth = dataclasses.replace(leaking.truth, faults=tuple(faults), degree=degree)
    cases = cases_of(truth, dataclasses.replace(leaking.trace, verdict=(word,) * n))
    assert {named} == set(cases.named)
    if word == "C.clogging":  # is diagnosed, but not what is there
        assert {0.0} == set(cases.degree[cases.fault >= 0])


TRUTHS = {
    "no time": ("A.leakage [1]\n0\n", "there is no time column"),
    "no fault": ("time [s],A.lekage [1]\n0,0\n", "did you mean 'A.leakage'?"),
    "percent": ("time [s],A.leakage [%]\n0,20\n", "write 'A.leakage [1]'"),
    "twice": ("time [s],A.leakage,A.leakage [1]\n0,0,0\n", "two columns hold A.leakage"),
    "negative": ("time [s],A.leakage [1]\n0,-0.1\n", "a true degree is negative"),
    "dates": ("time,A.leakage [1]\n2025-01-01 00:00:00,0\n", "the times are dates"),
    "elsewhere": ("time [s],A.leakage [1]\n900,0\n901,0\n", "no time of it lies at a sample"),
    "empty": ("", "the file is empty"),
}


@pytest.mark.parametrize("case", TRUTHS)
def test_unusable_truth_is_refused(case: str, healthy: Judged, tmp_path: Path) -> None:
    content, message = TRUTHS[case]
    path = write(tmp_path, content, "truth.csv")
    with pytest.raises(RecordingRefused) as caught:
        read_truth(path, healthy.diagnosis.ruleset, healthy.recording)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_truth_of_other_times_is_matched(healthy: Judged, tmp_path: Path) -> None:
    """The nearest time counts, up to half an interval; the rest is unknown and noted."""
    lines = "".join(f"{t + 0.2},{0.1 * (t > 10)},0\n" for t in range(20, -1, -1))
    path = write(tmp_path, "time [s],A.leakage,A.lekage [1]\n" + lines, "t.csv")
    truth = read_truth(path, healthy.diagnosis.ruleset, healthy.recording)
    assert [0.0] * 11 + [0.1] * 10 == list(truth.degree[0, :21])
    assert np.isnan(truth.degree[0, 21:]).all()
    assert (
        "t.csv: 'A.lekage [1]' is no fault of this plant and is left out; "
        "did you mean 'A.leakage'?",
        "t.csv: 39 of 60 samples have no truth",
    ) == truth.notes


def every_page() -> dict[str, tuple[str, str]]:
    """A page of every kind, small and quickly made, with the verdict that must be its heading."""
    abc = compiled("abc")
    leaking = dated(judge(EXAMPLES / "leakage_A.csv", abc, EXAMPLES / "leakage_A.truth.csv"))
    healthy = judge(EXAMPLES / "healthy.csv", abc)
    points = Points({"A.n": np.array([10.0]), "B.n": np.array([10.0])})
    study, proof, experiment = counted(), run(60), made_by_hand()
    of_study = StudyResult(
        ruleset=abc, types=TYPES, points=points, settings=Settings(), counts=study
    )
    return {
        "diagnosis": (leaking.page("leakage_A.csv"), verdict(leaking.diagnosis)),
        "healthy": (healthy.page("healthy.csv"), verdict(healthy.diagnosis)),
        **{
            f"mismatch {name}": (mismatch_page(one), mismatch_verdict(one)[0])
            for name, one in ALL.items()
        },
        "experiment": (
            experiment_page(experiment, abc, MADE),
            experiment.headline.removesuffix("."),
        ),
        "study": (of_study.page(MADE), study_verdict(study)),
        "matrix": (matrix_page(abc, MADE), matrix_verdict(abc)),
        "proof": (prove_page(proof, MADE), prove_headline(proof, table(proof.judged))),
    }


CUT = """(() => {
  const cut = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const part = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || !part.checkVisibility()) continue;
    if (part.closest('.scroll, title, thead, .symbols')) continue;
    const range = document.createRange();
    range.selectNodeContents(walk.currentNode);
    const box = range.getBoundingClientRect();
    if (box.width && (box.left < 0 || box.right > innerWidth)) cut.push(walk.currentNode.data);
  }
  return cut;
})()"""
"""Texts that stick out of the window, and are in no frame that scrolls."""

WIDE = """[...document.querySelectorAll('.fold')].filter(
  (table) => table.scrollWidth > table.parentElement.clientWidth + 1).length"""
"""Tables that should have become cards, and did not."""

OVER_THE_EDGE = """[...document.querySelectorAll('.scroll')].filter(
  (frame) => frame.scrollWidth > frame.clientWidth + 1
    || frame.getBoundingClientRect().right > innerWidth).length"""
"""Frames that scroll on a screen, and would have to on paper."""

UNSPOKEN = """[...document.querySelectorAll('svg:not([aria-hidden])')].filter(
  (svg) => !svg.closest('[role=img]')?.getAttribute('aria-label')).length"""
"""Pictures without words for those who cannot see them."""

HEADINGS = "[...document.querySelectorAll('h1')].map((heading) => heading.textContent)"


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


SHUT = """(() => [...document.querySelectorAll('details > :not(summary)')].filter(
  (part) => !part.checkVisibility({contentVisibilityAuto: true})
    || part.getBoundingClientRect().height === 0).length)()"""
"""What nobody can open on paper."""

PAPER = 680
"""Pixels across the text of a sheet of A4, upright."""


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")
def test_every_page_fits_telephone_screen_and_paper_and_says_its_verdict_first(
    chromium: Browser, tmp_path: Path
) -> None:
    pages = every_page()
    wrong: list[tuple[str, str, object]] = []
    for name, (page, heading) in pages.items():
        file = tmp_path / f"{name.replace(' ', '-')}.html"
        file.write_text(page, encoding="utf-8")
        chromium.look(390)
        chromium.open(file.as_uri())
        found: dict[str, object] = {}
        for width, scheme in ((w, s) for w in (390, 1280) for s in ("light", "dark")):
            chromium.look(width, scheme)
            found[f"weak at {width}, {scheme}"] = chromium.run(CONTRAST)
            if scheme == "light":
                found |= _misfits(chromium, width)
        chromium.look(PAPER, "dark")
        chromium.print(True)
        found |= _misfits(chromium, PAPER)
        found["shut on paper"] = chromium.run(SHUT)
        found["cut on paper"] = chromium.run(OVER_THE_EDGE)
        found["weak on paper"] = chromium.run(CONTRAST)
        chromium.print(False)
        if [heading] != chromium.run(HEADINGS):
            wrong.append((name, "heading", heading))
        wrong += [(name, what, value) for what, value in found.items() if value]
    assert [] == wrong
    assert [] == chromium.complaints()
    assert {f"{n.replace(' ', '-')}.html" for n in pages} == {
        url.rsplit("/")[-1] for url in chromium.asked_for()
    }


def _misfits(chromium: Browser, width: int) -> dict[str, object]:
    """What does not fit a window or a sheet so wide; wide tables may scroll but on a telephone."""
    return {
        f"sideways at {width}": chromium.run(f"document.documentElement.scrollWidth > {width}"),
        f"cut at {width}": chromium.run(CUT),
        f"no cards at {width}": width == 390 and chromium.run(WIDE),
        f"unspoken at {width}": chromium.run(UNSPOKEN),
    }
