"""The report: self-contained, safe, small, and every number in it computed from the data."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.evaluated_points import (
    evaluate_samples,
    evaluate_stretches,
    residuals_at,
)
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.stationary import settle
from rulec_runtime.report.series import detail
from rulec_runtime.report.wording import titled

from rulec.cli import main
from tests.conftest import ROOT
from tests.runtime.reports import (
    EXAMPLES,
    NEEDS_MORE,
    NO_NUMBER,
    Judged,
    caption,
    figures,
    judge,
    tree,
)
from tests.runtime.sheets import Sheet, example, write

SHEET = example()
USUAL = ["estimates", "residuals", "degrees"]
COMPARING = [*USUAL, "cases", "shares"]
"""Figures 10 and 11 of the paper only where somebody knows what was wrong."""

LEAKING = ("A.pump-plant", "A.power-plant", "C.pump-resis", "C.power-resis")
"""Residuals that compare an estimate of A's pump with one behind the leak."""

HOSTILE = "<script src='//x'>\"&\u202e\x07</script>"

BENT = {
    "one sample": lambda s: dataclasses.replace(s, rows=s.rows[:1]),
    "three samples": lambda s: dataclasses.replace(s, rows=s.rows[:3]),
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
    assert USUAL == figures(page)
    assert [] == NO_NUMBER.findall(page)
    if case == "one sample":
        assert page.index("the recording has 1 sample") < page.index("<figure")
        assert "Figure 3. Nothing was judged, so no degree is known." == caption(page, "degrees")


def test_page_needs_nothing_else(leaking: Judged, abc: Ruleset) -> None:
    """Same input, same bytes: no date, no order by chance."""
    page = leaking.page()
    assert [] == NEEDS_MORE.findall(page)
    names = {e.get("id") for e in tree(page).iter("symbol")}
    assert {f"#{name}" for name in names} >= {e.get("href") for e in tree(page).iter("use")}
    again = judge(EXAMPLES / "leakage_A.csv", abc, EXAMPLES / "leakage_A.truth.csv")
    assert page == again.page()


def test_hostile_names_stay_text(abc: Ruleset) -> None:
    words = dict.fromkeys(("title", "text", "action", "meaning", "origin"), HOSTILE)
    ruleset = dataclasses.replace(
        abc,
        title=HOSTILE,
        modules=dict.fromkeys(abc.modules, HOSTILE),
        faults=tuple(dataclasses.replace(f, **words) for f in abc.faults),
        observers=tuple(dataclasses.replace(o, equation=HOSTILE) for o in abc.observers),
    )
    judged = judge(EXAMPLES / "leakage_A.csv", ruleset, EXAMPLES / "leakage_A.truth.csv")
    judged = dataclasses.replace(
        judged,
        diagnosis=dataclasses.replace(judged.diagnosis, notes=(HOSTILE,)),
        truth=dataclasses.replace(judged.truth, name=HOSTILE, notes=(HOSTILE,)),
    )
    page = judged.page("\udcff" + HOSTILE)
    found = tree(page)
    assert [] == list(found.iter("script"))
    heading = found.findtext(".//h1") or ""
    assert heading.startswith("<script src='//x'>\"&��</script> in A: 60.0")
    assert page.encode("utf-8").decode("utf-8") == page


def test_faults_are_titled_with_their_module(abc: Ruleset) -> None:
    titles = {name: titled(abc.fault_by_id[name]) for name in ("C.clogging", "C.dp.high")}
    assert {"C.clogging": "clogging in C", "C.dp.high": "C.dp reads high"} == titles


def test_finding_comes_first(leaking: Judged) -> None:
    page, found = leaking.page(), tree(leaking.page())
    parts = ("Internal leakage in A", "What to do", "Why</h2>", "<figure", 'matrix">')
    places = [page.index(words) for words in parts]
    assert sorted(places) == places
    assert leaking.diagnosis.ruleset.sources in page
    head = found.find(".//header")
    words = " ".join(" ".join(head.itertext()).replace("\xa0", " ").split())
    assert "Diagnosis ◆ M Internal leakage in A: 60.0 % ± 0.4 % Maintenance required" in words
    assert "Recording x.csv Span 0-79 s (1 min 19 s), 80 samples Ruleset made of" in words
    assert "Made 2026-09-22 08:15 UTC by rulec-runtime 1.2.3" in words
    assert ["◆ A"] == [b.findtext("text") for b in head.findall(".//g[@class='box is-M']")]
    rows = [r for r in found.iter("tr") if "found" in (r.get("class") or "")]
    assert [["A.leakage"]] == [[h.text for h in r.iter("th")] for r in rows]


def seen_alone(judged: Judged) -> tuple[Observed, Array, Array]:
    """All samples as read, and residuals with their thresholds against the baseline, l/h."""
    recording, ruleset = judged.recording, judged.diagnosis.ruleset
    stretches, noise = settle(recording, ruleset)
    known = evaluate_stretches(recording, ruleset, stretches, noise, "default", keep=True)
    every = np.arange(len(recording))
    [(_, seen)] = evaluate_samples(recording, ruleset, noise, stretches, known, every)
    values, u = residuals_at(ruleset, seen)
    return seen[0].plain, values * 3.6e6, limits.THRESHOLD * u * 3.6e6


def test_residuals_fire_where_they_exceed_their_threshold(leaking: Judged) -> None:
    """One triangle a judged sample beyond its threshold; the leak of A lifts the estimates
    of its pump on all 27 samples of three plateaus.

    Beyond three standard uncertainties lies one sample in 370: of five residuals that it leaves
    alone on 72 samples B.pump-plant, once, and the caption and the panel say so.
    """
    found = tree(leaking.page()).findall(".//figure[@id='residuals']//svg[@aria-label]")
    marks = {svg.get("aria-label"): [u.get("href") for u in svg.iter("use")] for svg in found}
    _, values, thresholds = seen_alone(leaking)
    settled = np.array(leaking.trace.verdict) != "moving"
    up, down = settled & (values > thresholds), settled & (values < -thresholds)
    ids = [r.id for r in leaking.diagnosis.ruleset.residuals]
    expected = {
        name: ["#up"] * int(u.sum()) + ["#down"] * int(d.sum())
        for name, u, d in zip(ids, up, down, strict=True)
    }
    assert expected == marks
    named = [verdict == "A.leakage" for verdict in leaking.trace.verdict]
    assert [named] * 4 == up[[ids.index(name) for name in LEAKING]].tolist()
    others = [i for i, name in enumerate(ids) if name not in LEAKING]
    assert (27, 5, 72, 1) == (sum(named), len(others), settled.sum(), (up | down)[others].sum())
    said = caption(leaking.page(), "residuals")
    assert said.endswith("the other 5 stay inside but for one or two samples.")
    assert 1 == leaking.page().count(">brief</text>")


def test_caption_of_estimates_is_computed(leaking: Judged) -> None:
    plain, values, thresholds = seen_alone(leaking)
    ruleset, last = leaking.diagnosis.ruleset, slice(51, 60)
    index = ruleset.observer_index
    pump, plant = (plain.flows[index[name], last] * 3.6e6 for name in ("A.pump", "A.plant"))
    row = [r.id for r in ruleset.residuals].index("A.pump-plant")
    expected = (
        f"Figure 1. The pump estimate of A stands {np.mean(pump - plant):.0f} l/h above the plant "
        f"estimate from 51 s to 59 s, up by {np.mean(values[row, last]):.0f} l/h against what was "
        f"taken for fault-free, beyond the threshold of {np.mean(thresholds[row, last]):.1f} l/h; "
        "2 other periods shown lie beyond it."
    )
    assert expected == caption(leaking.page(), "estimates")


def test_captions_of_comparison_are_computed(leaking: Judged) -> None:
    """From the trace and the truth file alone."""
    table = np.genfromtxt(EXAMPLES / "leakage_A.truth.csv", delimiter=",", skip_header=1)
    true, words = table[:, 1], np.array(leaking.trace.verdict)
    row = [f.id for f in leaking.diagnosis.ruleset.faults].index("A.leakage")
    settled = words != "moving"
    named = settled & (true > 0) & (words == "A.leakage")
    off = np.abs(leaking.trace.degree[row] - true)
    expected = (
        f"Figure 4. The right fault is named in {named.sum()} of {(settled & (true > 0)).sum()} "
        f"samples with a fault; there its degree is off by {off[named].mean():.2g} on average and "
        f"{off[named].max():.2g} at most, and the bounds hold the truth in 100 %; "
        f"on {(settled & (true == 0)).sum()} samples without a fault nothing is reported."
    )
    page = leaking.page()
    assert expected == caption(page, "cases")
    assert f"discrepancy is {off[settled].mean():.2g}." in caption(page, "shares")
    largest = max(leaking.diagnosis.findings, key=lambda f: f.degree)
    expected = (
        f"Figure 3. A.leakage reaches {largest.degree:.3f} (95 %: {largest.lower:.3f} to "
        f"{largest.upper:.3f}) from 51 s to 59 s, the largest of 3 findings."
    )
    assert expected == caption(page, "degrees")


def test_long_recordings_give_small_files(leaking: Judged) -> None:
    recording, ruleset, n = leaking.recording, leaking.diagnosis.ruleset, 80 * 25
    repeated = dataclasses.replace(
        recording,
        time=np.arange(float(n)),
        values={name: np.tile(v, 25) for name, v in recording.values.items()},
        segment=np.zeros(n, dtype=int),
    )
    judged = Judged(repeated, diagnose(repeated, ruleset), trace(repeated, ruleset), None)
    assert len(judged.page().encode()) < 400_000
    assert len(detail(judged.curves()).time) < 600


def test_command_writes_the_report(
    tmp_path: Path, abc: Ruleset, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--report` and `--truth`; without a report the truth is of no use, and that is said."""
    recording, truth = str(EXAMPLES / "leakage_A.csv"), str(EXAMPLES / "leakage_A.truth.csv")
    plant, target = str(ROOT / "plants" / "abc"), tmp_path / "r.html"
    assert 0 == main(["diagnose", plant, recording, "--report", str(target), "--truth", truth])
    assert COMPARING == figures(target.read_text(encoding="utf-8"))
    rules = tmp_path / "abc.json"
    rules.write_text(abc.to_json(), encoding="utf-8")
    told = ["diagnose", str(rules), recording]
    assert 0 == main([*told, "--truth", truth])
    assert "only a report" in capsys.readouterr().out
    assert 1 == main([*told, "--truth", str(tmp_path / "no.csv")])
    assert "no.csv: No such file" in capsys.readouterr().err
    assert 2 == main([*told, "--report", str(tmp_path / "no" / "r.html")])
    assert "make it first" in capsys.readouterr().err
