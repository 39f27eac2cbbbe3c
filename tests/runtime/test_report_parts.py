"""Parts of the report on their own: truth, axes, thinning."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.report.chart import Panel, axis
from rulec_runtime.report.terminal_story import explain
from rulec_runtime.report.thin_curves import COLUMNS, thin_marks, thin_series
from rulec_runtime.report.truth import Cases, cases_of, read_truth, shares

from tests.runtime.reports import Judged
from tests.runtime.sheets import write


def test_shares_sum_to_one(leaking: Judged, abc: Ruleset) -> None:
    """Every case lies in exactly one cell."""
    assert leaking.truth is not None
    table = shares(cases_of(leaking.truth, leaking.trace))
    assert table.sum() == pytest.approx(1.0, abs=1e-12)
    assert {0.0} == set(np.delete(table, 4, axis=0).ravel())


def test_shares_by_hand() -> None:
    """Four cases: right, a little low, far too high, a false alarm."""
    true, degree = np.array([0.2, 0.4, 0.9, 0.0]), np.array([0.21, 0.3, 1.9, 0.12])
    named = np.array([True, True, True, False])
    cases = Cases(
        names=("x",),
        fault=np.array([0, 0, 0, -1]),
        true=true,
        degree=degree,
        lower=degree,
        upper=degree,
        named=named,
    )
    expected = np.zeros((9, 5))
    expected[4, 1] = expected[3, 2] = expected[8, 4] = expected[5, 0] = 0.25
    np.testing.assert_array_equal(expected, shares(cases))


def test_another_fault_counts_as_nothing_found(leaking: Judged, abc: Ruleset) -> None:
    """Truth about B while A is diagnosed: degree 0, not named; A alone is a false alarm."""
    assert leaking.truth is not None
    swapped = dataclasses.replace(leaking.truth, faults=("B.leakage",))
    cases = cases_of(swapped, leaking.trace)
    assert {0.0} == set(cases.degree[cases.fault >= 0])
    assert not cases.named[cases.fault >= 0].any()
    none = dataclasses.replace(leaking.truth, degree=np.zeros_like(leaking.truth.degree))
    cases = cases_of(none, leaking.trace)
    assert 27 == int((~cases.named).sum())
    assert 0.6 == round(float(cases.discrepancy.max()), 1)


def judged_as(judged: Judged, word: str, faults: dict[str, float], ruleset: Ruleset) -> Cases:
    """All samples with the same words in the trace and the same true degrees."""
    assert judged.truth is not None
    n = len(judged.trace.time)
    degree = np.array([np.full(n, x) for x in faults.values()])
    truth = dataclasses.replace(judged.truth, faults=tuple(faults), degree=degree)
    return cases_of(truth, dataclasses.replace(judged.trace, verdict=(word,) * n))


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
    word: str, faults: dict[str, float], named: bool, leaking: Judged, abc: Ruleset
) -> None:
    """The largest true fault must be among those named, and no false one beside it."""
    assert {named} == set(judged_as(leaking, word, faults, abc).named)


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
    """Each with the place and the remedy."""
    content, message = TRUTHS[case]
    path = write(tmp_path, content, "truth.csv")
    with pytest.raises(RecordingRefused) as caught:
        read_truth(path, healthy.diagnosis.ruleset, healthy.recording)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_truth_of_other_times_is_matched(healthy: Judged, tmp_path: Path) -> None:
    """The nearest time counts, up to half an interval; the rest is unknown and noted."""
    lines = "".join(f"{t + 0.2},{0.1 * (t > 10)}\n" for t in range(20, -1, -1))
    content = "time [s],A.leakage,A.lekage [1]\n" + lines.replace("\n", ",0\n")
    path = write(tmp_path, content, "t.csv")
    truth = read_truth(path, healthy.diagnosis.ruleset, healthy.recording)
    assert [0.0] * 11 + [0.1] * 10 == list(truth.degree[0, :21])
    assert np.isnan(truth.degree[0, 21:]).all()
    assert (
        "t.csv: 'A.lekage [1]' is no fault of this plant and is left out; "
        "did you mean 'A.leakage'?",
        "t.csv: 39 of 60 samples have no truth",
    ) == truth.notes


@given(st.floats(-1e6, 1e6), st.floats(0, 1e6), st.integers(2, 9))
def test_axes_have_sensible_ticks(low: float, span: float, wanted: int) -> None:
    """Inside the axis, even, not too few and not too many, with different labels."""
    scale = axis(low, low + span, wanted)
    assert scale.low <= scale.ticks[0]
    assert scale.ticks[-1] <= scale.high
    assert 1 <= len(scale.ticks) <= 2 * wanted + 1
    assert len(scale.ticks) == len(set(scale.labels()))


@given(st.lists(st.floats(-1e3, 1e3) | st.just(float("nan")), min_size=1, max_size=4000))
def test_thin_series_keeps_the_extremes(values: list[float]) -> None:
    """At most two points a column, and neither the largest nor the smallest value is lost."""
    time, series = np.arange(float(len(values))), np.array(values)
    _, thin = thin_series(time, series)
    assert len(thin) <= 2 * COLUMNS
    if np.isfinite(series).any():
        assert (np.nanmin(series), np.nanmax(series)) == (np.nanmin(thin), np.nanmax(thin))


def test_pauses_break_a_curve() -> None:
    """No stroke leads across a pause of the recording, nor across missing readings."""
    time = np.array([0.0, 1, 2, 50, 51, 52, 53])
    values = np.array([1.0, 1, 1, 1, np.nan, 1, 1])
    scale = axis(0.0, 60.0)
    drawn = Panel(scale, scale, 100).curve(*thin_series(time, values), "")
    assert 3 == drawn.count("M")


def test_marks_stay_apart() -> None:
    """One mark a column, at the largest value; none where nothing was chosen."""
    time, size = np.arange(100.0), np.arange(100.0)
    assert [49, 99] == list(thin_marks(time, size, time >= 0, 2))
    assert [] == list(thin_marks(time, size, time < 0, 10))


def test_names_stay_whole_on_a_narrow_terminal(leaking: Judged) -> None:
    """Long periods and bounds go on in the next line instead."""
    finding = leaking.diagnosis.findings[0]
    again = dataclasses.replace(
        finding, since=finding.since + 40_000.0, until=finding.until + 90_000.0
    )
    out = Terminal(file=io.StringIO(), width=52, color_system=None)
    explain(out, dataclasses.replace(leaking.diagnosis, findings=(finding, again)))
    assert isinstance(out.file, io.StringIO)
    table = out.file.getvalue().split("probability")[1].split("\n\n")[0]
    assert table.count(finding.fault.id) == 2
    assert "…" not in table
