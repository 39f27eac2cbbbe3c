"""The report: self-contained, safe, small, and every number in it computed from the data."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main
from runtime.diagnose import diagnose
from runtime.observe import observe, points_of_samples
from runtime.report.series import detail
from runtime.ruleset import Ruleset
from runtime.stationary import noise_of
from runtime.trace import trace
from runtime.wording import titled
from tests.conftest import ROOT, compiled, recordings_folder
from tests.runtime.reports import EXAMPLES, Judged, caption, figures, judge, tree
from tests.runtime.sheets import Sheet, example, write

SHEET = example()
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
    """Whatever could be judged of it: well-formed, with all figures over time, without NaN."""
    bent: Sheet = BENT[case](SHEET)
    judged = judge(write(tmp_path, bent.text()), abc)
    page = judged.page()
    assert ["estimates", "residuals", "degrees"] == figures(page)
    assert [] == re.findall(r"[ \"(]-?(?:nan|inf)\b", page)


def test_nothing_judged_says_why_first(abc: Ruleset, tmp_path: Path) -> None:
    """The reason stands above the pictures, and no figure claims anything."""
    path = write(tmp_path, dataclasses.replace(SHEET, rows=SHEET.rows[:2]).text())
    page = judge(path, abc).page()
    assert page.index("the recording has 2 samples") < page.index("<figure")
    assert "Figure 3. Nothing was judged, so no degree is known." == caption(page, "degrees")


def test_page_needs_nothing_else(leaking: Judged) -> None:
    """No address, no script, no import; references lead to shapes of the page itself."""
    page = leaking.page()
    assert [] == re.findall(r"https?:|//\w|<script|<img|<link|@import|url\(|\ssrc=|\son\w+=", page)
    names = {e.get("id") for e in tree(page).iter("symbol")}
    assert {f"#{name}" for name in names} >= {e.get("href") for e in tree(page).iter("use")}


def test_figures_that_compare_need_truth(leaking: Judged, healthy: Judged) -> None:
    """Figures 10 and 11 of the paper only where somebody knows what was wrong."""
    assert ["estimates", "residuals", "degrees", "cases", "shares"] == figures(leaking.page())
    assert ["estimates", "residuals", "degrees"] == figures(healthy.page())


def test_same_input_same_bytes(leaking: Judged, abc: Ruleset) -> None:
    """No date, no order by chance."""
    again = judge(EXAMPLES / "leakage_A.csv", abc, EXAMPLES / "leakage_A.truth.csv")
    assert leaking.page() == again.page()


def test_hostile_names_stay_text(abc: Ruleset) -> None:
    """Titles, texts, remarks and file names come out as written, never as markup."""
    faults = tuple(
        dataclasses.replace(
            f, title=HOSTILE, text=HOSTILE, action=HOSTILE, meaning=HOSTILE, origin=HOSTILE
        )
        for f in abc.faults
    )
    observers = tuple(dataclasses.replace(o, equation=HOSTILE) for o in abc.observers)
    ruleset = dataclasses.replace(abc, title=HOSTILE, faults=faults, observers=observers)
    judged = judge(EXAMPLES / "leakage_A.csv", ruleset, EXAMPLES / "leakage_A.truth.csv")
    assert judged.truth is not None
    judged = dataclasses.replace(
        judged,
        diagnosis=dataclasses.replace(judged.diagnosis, notes=(HOSTILE,)),
        truth=dataclasses.replace(judged.truth, name=HOSTILE, notes=(HOSTILE,)),
    )
    page = judged.page("\udcff" + HOSTILE)
    found = tree(page)
    assert [] == list(found.iter("script"))
    heading = found.find(".//h1")
    assert heading is not None
    assert "<script src='//x'>\"&��</script>" == heading.text
    assert page.encode("utf-8").decode("utf-8") == page


def test_faults_are_titled_with_their_module(abc: Ruleset) -> None:
    """Also where the module's name is a letter of the title; not where the title holds it."""
    titles = {name: titled(abc.fault_by_id[name]) for name in ("C.clogging", "C.dp.high")}
    assert {"C.clogging": "clogging in C", "C.dp.high": "C.dp reads high"} == titles


def test_finding_comes_first(leaking: Judged) -> None:
    """Order: what is wrong, why, pictures, matrix, origin."""
    page = leaking.page()
    places = [
        page.index(words)
        for words in ("Internal leakage in A", "What to do", "Why</h2>", "<figure", 'matrix">')
    ]
    assert sorted(places) == places
    assert leaking.diagnosis.ruleset.sources in page


def test_matrix_marks_the_rows_found(leaking: Judged) -> None:
    """Of all rows exactly that of the diagnosed fault stands out."""
    rows = [r for r in tree(leaking.page()).iter("tr") if "found" in (r.get("class") or "")]
    assert [["A.leakage"]] == [[h.text for h in r.iter("th")] for r in rows]


def test_residuals_fire_where_they_exceed_their_limit(leaking: Judged) -> None:
    """One triangle a fired sample: 27 samples of three plateaus, all upwards."""
    found = tree(leaking.page()).findall(".//figure[@id='residuals']//svg[@aria-label]")
    marks = {svg.get("aria-label"): [u.get("href") for u in svg.iter("use")] for svg in found}
    assert ["#up"] * 27 == marks["A.pump-plant"]
    assert [] == marks["B.pump-plant"]


def test_caption_of_estimates_is_computed(leaking: Judged, abc: Ruleset) -> None:
    """Distance and limit of the two estimates, from the observers alone."""
    recording = leaking.recording
    noise = {name: noise_of(values) for name, values in recording.values.items()}
    observed = observe(abc, points_of_samples(recording, abc, noise))
    index = {o.id: i for i, o in enumerate(abc.observers)}
    first, other = (observed.flows[index[n], 51:60] * 3.6e6 for n in ("A.pump", "A.plant"))
    own = observed.covariance[51:60][:, [[index["A.pump"]], [index["A.plant"]]], :]
    limit = own
    expected = (
        f"Figure 1. The pump estimate of A stands {np.mean(first - other):.0f} l/h above the plant "
        f"estimate from 51 s to 59 s, beyond the limit of {np.mean(limit):.0f} l/h; so it does in "
        "2 other periods shown."
    )
    assert expected == caption(leaking.page(), "estimates")


def test_captions_of_comparison_are_computed(leaking: Judged) -> None:
    """Rate, error and coverage, from the trace and the truth file alone."""
    table = np.genfromtxt(EXAMPLES / "leakage_A.truth.csv", delimiter=",", skip_header=1)
    true = table[:, 1]
    words = np.array(leaking.trace.verdict)
    row = [f.id for f in leaking.diagnosis.ruleset.faults].index("A.leakage")
    degree = leaking.trace.degree[row]
    settled = words != "moving"
    named = settled & (true > 0) & (words == "A.leakage")
    off = np.abs(degree - true)
    expected = (
        f"Figure 4. The right fault is named in {named.sum()} of {(settled & (true > 0)).sum()} "
        f"samples with a fault; there its degree is off by {off[named].mean():.2g} on average and "
        f"{off[named].max():.2g} at most, and the bounds hold the truth in 100 %; "
        f"on {(settled & (true == 0)).sum()} samples without a fault nothing is reported."
    )
    page = leaking.page()
    assert expected == caption(page, "cases")
    assert f"discrepancy is {off[settled].mean():.2g}." in caption(page, "shares")


def test_caption_of_degrees_is_the_finding(leaking: Judged) -> None:
    """The largest finding with its bounds, as in the diagnosis."""
    largest = max(leaking.diagnosis.findings, key=lambda f: f.degree)
    expected = (
        f"Figure 3. A.leakage reaches {largest.degree:.3f} (95 %: {largest.lower:.3f} to "
        f"{largest.upper:.3f}) from 51 s to 59 s, the largest of 3 findings."
    )
    assert expected == caption(leaking.page(), "degrees")


def long(judged: Judged, times: int) -> Judged:
    """A recording repeated, one behind the other."""
    recording, n = judged.recording, len(judged.recording)
    repeated = dataclasses.replace(
        recording,
        time=np.arange(float(n * times)),
        values={name: np.tile(v, times) for name, v in recording.values.items()},
        segment=np.zeros(n * times, dtype=int),
    )
    ruleset = judged.diagnosis.ruleset
    return Judged(repeated, diagnose(repeated, ruleset), trace(repeated, ruleset), None)


def test_long_recordings_give_small_files(leaking: Judged) -> None:
    """8000 samples instead of 80: a few hundred kB, and the estimates of a part only."""
    judged = long(leaking, 100)
    assert len(judged.page().encode()) < 400_000
    assert len(detail(judged.curves()).time) < 600


def test_zema_recording_gives_a_small_file() -> None:
    """100,000 samples of a real rig."""
    path = recordings_folder() / "zema-hydraulic" / "recording.csv.gz"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    page = judge(path, compiled("zema-hydraulic")).page()
    assert ["estimates", "residuals", "degrees"] == figures(page)
    assert len(page.encode()) < 300_000


def test_command_writes_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--report` and `--truth`; without a report the truth is of no use, and that is said."""
    recording, truth = str(EXAMPLES / "leakage_A.csv"), str(EXAMPLES / "leakage_A.truth.csv")
    plant, target = str(ROOT / "plants" / "abc"), tmp_path / "r.html"
    assert 0 == main(["diagnose", plant, recording, "--report", str(target), "--truth", truth])
    assert ["estimates", "residuals", "degrees", "cases", "shares"] == figures(
        target.read_text(encoding="utf-8")
    )
    assert 0 == main(["diagnose", plant, recording, "--truth", truth])
    assert "only a report" in capsys.readouterr().out
    assert 1 == main(["diagnose", plant, recording, "--truth", str(tmp_path / "no.csv")])
    assert "no.csv: cannot be read" in capsys.readouterr().err
    assert 1 == main(["diagnose", plant, recording, "--report", str(tmp_path / "no" / "r.html")])
    assert "No such file or directory" in capsys.readouterr().err
