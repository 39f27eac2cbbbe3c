"""What a person and a program are told, word for word; what holds for any page.

Golden files are re-made only by `make golden`, and reviewed as a diff."""

import json
import os
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.report import html_findings
from rulec_runtime.report.json_form import diagnosis_form
from rulec_runtime.report.parts import part_html
from rulec_runtime.report.series import detail
from rulec_runtime.report.terminal_findings import explain

from rulec.cli import main
from rulec.commands.matrix import json_form as matrix_form
from rulec.commands.matrix import matrix_page
from rulec.knowledge.parameter_belief import Strain
from rulec.mismatch.answer.findings import update_sentence
from rulec.mismatch.answer.json_form import latent_csv, mismatch_form
from rulec.mismatch.answer.pictures import curves_of, rms
from rulec.mismatch.answer.terminal_and_page import tell
from rulec.mismatch.experiment.recipe import experiment_page
from rulec.mismatch.experiment.result import Reading
from rulec.mismatch.result import (
    Errors,
    Evidence,
    Likely,
    Mismatch,
    Moved,
    OfRecording,
    Region,
    Update,
)
from rulec.separation.propose import Proposal, set_points
from rulec.simulation.signature import signature_of
from tests.conftest import ROOT, Capsys, compiled
from tests.runtime import (
    test_blind,
    test_courses,
    test_dynamic_diagnose,
    test_frequencies,
    test_regimes,
    test_sensor_health,
)
from tests.runtime.mismatches import (
    ALL,
    FAULT,
    NAMED,
    NAN,
    WARM,
    broken,
    curves,
    made_by_hand,
    spoken,
)
from tests.runtime.reports import (
    EXAMPLES,
    MADE,
    NEEDS_MORE,
    NO_NUMBER,
    Judged,
    dated,
    figures,
    judge,
    mismatch_page,
    shown,
    tree,
)
from tests.runtime.sheets import Sheet, example, write

WORSE = Errors(shipped=8.0, recalibrated=4.0, repaired=5.0, noise=1.0, points=1, explained=0.25)
MOVED = (Moved("a", "slip", 0.68, 0.97), Moved("b", "gap", None, 0.02))
CHANGED = {
    "doubted": replace(
        NAMED, refused="it may be chance", strain=(Strain("V.Kv", 6.8, 33.0, 6.0, "m3/h"),)
    ),
    "several": replace(
        NAMED,
        recordings=(
            OfRecording("1.csv", 144, 133, "ambiguous", (Likely("a", "slip", 0.68),)),
            OfRecording("2.csv", 144, 131, "none", ()),
        ),
        changed=(Update("2.csv", update_sentence("2.csv", MOVED), MOVED),),
    ),
    "worse": replace(
        NAMED,
        fit=replace(NAMED.fit, heldout=WORSE, gain_interval=(-0.5, -0.1), closed=-0.6),
        left_out=((NAMED.findings[0].id, "why"),),
        evidence=tuple(Evidence(20 - i, False, f"reason {i}") for i in range(10)),
    ),
}
"""Further answers: what speaks against a repair, several recordings, more than is shown."""


ROWS = ("tr", "p", "h1", "h2", "h3", "dt", "li", "figcaption", "summary", "header", "section")
"""Parts of a page that begin a line."""


def words(part: ET.Element) -> str:
    """Texts of a page, a row of a table in one line; of a drawing its label and its marks."""
    inner = "" if part.tag in ("style", "script", "svg") else part.text or ""
    inner += "".join(map(words, part)) if part.tag != "svg" else marks(part)
    return ("\n" if part.tag in ROWS else " ") + inner + " " + (part.tail or "")


def marks(svg: ET.Element) -> str:
    used = Counter(str(use.get("href")) for use in svg.iter("use"))
    counted = ", ".join(f"{n} {name}" for name, n in sorted(used.items()))
    return f"\n{svg.get('aria-label')}: {counted}\n" if used else ""


def lines_of(form: Any) -> Iterator[str]:
    """Data, an item of a list or a key of an object in a line; numbers to three digits."""
    for key, value in form.items():
        for item in value if isinstance(value, list) else [value]:
            text = json.dumps(item, ensure_ascii=False)
            yield f"{key}: " + re.sub(r"\d+\.\d{5,}", lambda n: f"{float(n[0]):.3g}", text)


def assert_as_reviewed(name: str, terminal: str, page: str, form: Any) -> None:
    parts = [terminal, *words(tree(page)).splitlines(), *lines_of(form)]
    lines = [" ".join(line.split()) for part in parts for line in part.splitlines()]
    text = "\n".join(line for line in lines if line) + "\n"
    text = text.replace(compiled("abc").sources, "(hash of the sources)")
    file = ROOT / "tests" / "golden" / f"{name.replace(' ', '-')}.txt"
    if os.environ.get("RULEC_REMAKE"):
        file.write_text(text, encoding="utf-8")
    assert file.read_text(encoding="utf-8").splitlines() == text.splitlines()


@pytest.mark.parametrize("case", {**ALL, **CHANGED})
def test_a_mismatch_is_told_as_reviewed(case: str) -> None:
    found: Mismatch = {**ALL, **CHANGED}[case]
    form = mismatch_form(found, "plants/abc/plant.yaml")
    terminal = shown(tell, found) + (latent_csv(found.latent_input) if found.latent_input else "")
    assert_as_reviewed(f"mismatch {case}", terminal, mismatch_page(found), form)


def test_a_page_of_a_diagnosis_is_as_reviewed(leaking: Judged, healthy: Judged) -> None:
    for name, judged in (("leaking", dated(leaking)), ("healthy", healthy)):
        form = diagnosis_form(judged.diagnosis)
        assert_as_reviewed(name, shown(explain, judged.diagnosis), judged.page(), form)


DIAGNOSES: dict[str, Callable[[], Diagnosis]] = {
    "blind": lambda: diagnose(test_blind.without(test_blind.run_of(), "A.dp"), compiled("abc")),
    "regime": lambda: test_regimes.said("abc", 1, speed=0.0, passage=test_regimes.OPEN),
    "liquid": lambda: test_regimes.said("abc", 1, *test_regimes.COLD, 15.0),
    "growing": lambda: test_courses.said("A.leakage", 0.4 * test_courses.SHARE, 8401),
    "coming and going": lambda: test_courses.coming_and_going(1, 200),
    "alike": test_frequencies.usual_and_common,
    "stores": test_dynamic_diagnose.blocked,
    "mended": lambda: test_sensor_health.mended("A.dp and B.dp exchanged"),
}


@pytest.mark.parametrize("case", DIAGNOSES)
def test_a_diagnosis_is_told_as_reviewed(case: str) -> None:
    found = DIAGNOSES[case]()
    page = f"<main>{''.join(map(part_html, html_findings.findings_parts(found)))}</main>"
    assert_as_reviewed(f"diagnosis {case}", shown(explain, found), page, diagnosis_form(found))


def test_a_matrix_and_an_experiment_are_told_as_reviewed() -> None:
    tanks = compiled("wastewater-lab")
    for rules, stores in ((compiled("abc"), None), (tanks, asdict(signature_of(tanks)))):
        page = matrix_page(rules, MADE)
        assert_as_reviewed(f"matrix {rules.plant}", "", page, matrix_form(rules, stores))
    # Of its readings one is predicted in some steps only; a way that takes no time has no column.
    page = experiment_page(made_by_hand(), compiled("abc"), MADE)
    assert_as_reviewed("experiment", "", page, {})


def test_a_recipe_and_a_step_write_large_numbers_out() -> None:
    """1 500 W and 15000 rpm, not 1.50e+03 and 1.5e+04."""
    found = made_by_hand()
    power = Reading("A.P_el", (1500.0, 1600.0), 5.0, (20.0, 20.0))
    steps = tuple(replace(step, readings=(power,)) for step in found.steps)
    page = experiment_page(replace(found, steps=steps), compiled("abc"), MADE)
    assert ">1\u202f500</td>" in page
    faster = Proposal(changes={"A.n": 18000.0}, here=(), apart=(), hold=60.0)
    text = set_points(compiled("abc"), {"A.n": 15000.0}, faster)
    assert text == "raise A.n from 15000 to 18000 rpm, and hold it for 60 s"


@pytest.mark.parametrize("case", ALL)
def test_every_verdict_is_told(case: str) -> None:
    """On one screen, a page that asks for nothing else, and data; nowhere a number that is not
    known."""
    rows = shown(tell, ALL[case], 80).splitlines()
    assert [] == [row for row in rows if len(row) > 80]
    assert 45 >= len(rows)
    text = shown(tell, broken(ALL[case]), 80).replace("(", " ").lower()
    assert set(text.split()).isdisjoint(("nan", "inf", "-inf"))
    for mismatch in (ALL[case], broken(ALL[case])):
        json.dumps(mismatch_form(mismatch, "plants/abc"), allow_nan=False)
        page = mismatch_page(mismatch)
        assert [] == NO_NUMBER.findall(page) + NEEDS_MORE.findall(page)


HOSTILE = "<script src='//x'>\"&\u202e\x07</script>"


def test_hostile_texts_stay_text() -> None:
    hostile = "[bold]x[/bold] [/] [red] \\"
    assert 15 <= shown(tell, spoken(hostile), 400).count(hostile)
    page = tree(mismatch_page(spoken(HOSTILE)))
    assert [] == [*page.iter("script"), *page.iter("img")]
    assert "<script src='//x'>\"&\ufffd\ufffd</script>" == page.findtext(".//h1")


def test_an_improbable_finding_is_not_told_as_the_only_one_that_fits() -> None:
    """Without another cause the rest of its probability is time in which it does not fit."""
    found = DIAGNOSES["growing"]()
    for probability, said in ((1.0, "no other known fault fits"), (0.19, "fits all of this time")):
        findings = tuple(replace(f, probability=probability) for f in found.findings)
        now = replace(found, findings=findings)
        page = "".join(map(part_html, html_findings.findings_parts(now)))
        assert said in shown(explain, now)
        assert ("no other one fits" in page) == (probability == 1.0)


def test_an_error_without_a_rule_leaves_no_empty_line() -> None:
    found = DIAGNOSES["growing"]()
    assert "rules and sources" in shown(explain, found)
    cells = tuple(replace(cell, equation="") for cell in found.ruleset.cells)
    lines = shown(explain, replace(found, ruleset=replace(found.ruleset, cells=cells))).splitlines()
    assert any(line.endswith("─ source") for line in map(str.rstrip, lines))
    assert not [line for line in lines if line.rstrip().endswith("─")]


def test_alternatives_beyond_three_are_counted() -> None:
    (first, *_), (finding, *rest) = WARM.alternatives, NAMED.findings
    many = replace(finding, alternatives=tuple(replace(first, title=f"slip {k}") for k in range(5)))
    words = " ".join(shown(tell, replace(NAMED, findings=(many, *rest)), 400).split())
    assert re.search(r"slip 2 \(\d+ %\) and 2 other explanations \(--json has all\)", words)


def test_a_mismatch_is_located_by_readings_or_else_in_time() -> None:
    time, warm = curves().time, curves().drivers["A.T [degC]"]
    np.testing.assert_array_equal(warm >= 45.0, curves_of(NAMED).located)
    periods = (time <= 25.0) | ((time >= 200.0) & (time <= 225.0))
    strange = Region("B.T", 45.0, None, "degC", 1.0)
    elsewhere = replace(FAULT.locations[0], region=(strange,))
    for mismatch in (FAULT, replace(FAULT, locations=(elsewhere,))):
        np.testing.assert_array_equal(periods, curves_of(mismatch).located)


def test_points_in_faults_do_not_count() -> None:
    c = curves()
    measured = np.where(c.time < 100, 0.0, c.measured)
    faulty = replace(c, measured=measured, inside=c.time >= 100)
    found = curves_of(replace(NAMED, curves=faulty))
    error = found.error("repaired")
    assert rms((c.measured - c.repaired)[100:]) == rms(error[np.isfinite(error)])
    assert 0.0 == found.curves.measured[0]


@pytest.mark.parametrize("samples", [1, 2, 3, 100_000])
def test_any_number_of_samples_makes_a_page(samples: int) -> None:
    page = mismatch_page(replace(NAMED, curves=curves(samples)))
    assert ["driver0", "time", "driver1"] == figures(page)
    assert [] == NO_NUMBER.findall(page)
    assert 600_000 > len(page)


def test_samples_out_of_order_or_without_time_are_sorted_out() -> None:
    """A chart needs an increasing time; of no sample, or none that was measured, there is none."""
    c = curves()
    time = c.time[::-1].copy()
    time[3] = NAN
    found = curves_of(replace(NAMED, curves=replace(c, time=time)))
    ordered = found.curves.time
    assert (len(time) - 1, True) == (len(ordered), bool((np.diff(ordered) > 0).all()))
    unmeasured = replace(c, measured=np.full(len(c.time), NAN))
    names = [f.name for f in fields(c) if f.name != "drivers"]
    none = replace(c, **dict.fromkeys(names, c.time[:0]), drivers={"x": c.time[:0]})
    for empty in (none, unmeasured):
        assert curves_of(replace(NAMED, curves=empty)) is None


SHEET = example()
USUAL = ["estimates", "residuals"]
COMPARING = [*USUAL, "degrees", "cases"]
"""Figure 10 of the paper only where somebody knows what was wrong."""


BENT = {
    "one sample": lambda s: replace(s, rows=s.rows[:1]),
    "three samples": lambda s: replace(s, rows=s.rows[:3]),
    "a stretch without readings": lambda s: s.filled("A.dp", "", 10, 25).filled("A.n", "", 10, 30),
    "no reading at all": lambda s: s.filled("A.dp", "").filled("B.dp", "").filled("C.dp", ""),
    "a signal missing": lambda s: s.without("C.dp"),
    "standstill": lambda s: s.filled("A.n", "0").filled("B.n", "0"),
    "nothing known fits": lambda s: s.filled("A.dp", "3.1", 20).filled("B.n", "500", 20),
}


@pytest.mark.parametrize("case", BENT)
def test_every_recording_gives_a_sound_page(case: str, abc: Ruleset, tmp_path: Path) -> None:
    bent: Sheet = BENT[case](SHEET)
    page = judge(write(tmp_path, bent.text()), abc).page()
    drawn = case not in ("one sample", "no reading at all")
    assert (USUAL if drawn else []) == figures(page)[:2]
    assert [] == NO_NUMBER.findall(page)
    if case == "one sample":
        assert "the recording has 1 sample" in page


def test_a_page_needs_nothing_else_and_marks_what_is_found(leaking: Judged, abc: Ruleset) -> None:
    """In picture and table. Same input, same bytes: no date, no order by chance."""
    page = leaking.page()
    found = tree(page)
    assert [] == NEEDS_MORE.findall(page)
    names = {e.get("id") for e in found.iter("symbol")}
    assert {f"#{name}" for name in names} >= {e.get("href") for e in found.iter("use")}
    marked = found.findall(".//header//g[@class='box is-M']")
    assert ["◆ A"] == [box.findtext("text") for box in marked]
    rows = [r for r in found.iter("tr") if "found" in (r.get("class") or "")]
    assert [["A.leakage"]] == [[h.text for h in r.iter("th")] for r in rows]
    again = judge(EXAMPLES / "leakage_A.csv", abc, EXAMPLES / "leakage_A.truth.csv")
    assert page == again.page()


def test_hostile_names_stay_text(abc: Ruleset) -> None:
    words = dict.fromkeys(("title", "text", "action", "meaning", "origin"), HOSTILE)
    ruleset = replace(
        abc,
        title=HOSTILE,
        modules=dict.fromkeys(abc.modules, HOSTILE),
        faults=tuple(replace(f, **words) for f in abc.faults),
        observers=tuple(replace(o, equation=HOSTILE) for o in abc.observers),
    )
    judged = judge(EXAMPLES / "leakage_A.csv", ruleset, EXAMPLES / "leakage_A.truth.csv")
    judged = replace(
        judged,
        diagnosis=replace(judged.diagnosis, notes=(HOSTILE,)),
        truth=replace(judged.truth, name=HOSTILE, notes=(HOSTILE,)),
    )
    page = judged.page("\udcff" + HOSTILE)
    found = tree(page)
    assert [] == list(found.iter("script"))
    heading = found.findtext(".//h1") or ""
    assert heading.startswith("<script src='//x'>\"&��</script> in A: 60.0")
    assert page.encode("utf-8").decode("utf-8") == page


def test_long_recordings_give_small_files(leaking: Judged) -> None:
    recording, ruleset, n = leaking.recording, leaking.diagnosis.ruleset, 80 * 25
    repeated = replace(
        recording,
        time=np.arange(float(n)),
        values={name: np.tile(v, 25) for name, v in recording.values.items()},
        segment=np.zeros(n, dtype=int),
    )
    judged = Judged(repeated, diagnose(repeated, ruleset), trace(repeated, ruleset), None)
    assert len(judged.page().encode()) < 400_000
    assert len(detail(judged.curves()).time) < 600


def test_command_writes_the_report(tmp_path: Path, abc: Ruleset, capsys: Capsys) -> None:
    """`--report` and `--truth`; without a report the truth is of no use, and that is said."""
    recording, truth = str(EXAMPLES / "leakage_A.csv"), str(EXAMPLES / "leakage_A.truth.csv")
    plant, target = str(ROOT / "plants" / "abc"), tmp_path / "r.html"
    assert 0 == main(["diagnose", plant, recording, "--report", str(target), "--truth", truth])
    assert COMPARING == figures(target.read_text(encoding="utf-8"))
    rules = tmp_path / "abc.json"
    rules.write_text(abc.to_json(), encoding="utf-8")
    assert 0 == main(["diagnose", str(rules), recording, "--truth", truth])
    assert "only a report" in capsys.readouterr().out
