"""Faults that grow: how large now, how fast, and when how large; nothing where nothing grows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.report.growth import draw_growth, grown, sparkline
from rulec_runtime.report.json_form import diagnosis_form

from rulec.prove.truth import healthy_run, record
from tests.method.readings import built, calibrated, recording, ruleset

SAMPLES = 720
Way = Callable[[np.ndarray], np.ndarray]

WAYS: dict[str, Way] = {
    "linear": lambda share: share,
    "accelerating": lambda share: share**2,
    "late": lambda share: np.maximum(share - 0.5, 0.0) / 0.5,
}


def said(fault: str, degree: np.ndarray, seed: int, interval: float = 5.0) -> Diagnosis:
    """What is said of a fault that takes this course while nothing else changes."""
    rules = calibrated(ruleset("abc"))
    run = healthy_run(built("abc"), len(degree))
    run = replace(run, faults={fault: degree} if fault else {})
    operation = replace(run.operation, time=interval * run.operation.time)
    made = record(replace(run, operation=operation), seed=seed)
    return diagnose(recording(rules, made.readings), rules)


def growing(fault: str, way: str, size: float, seed: int = 8401) -> Finding:
    """The only finding, of this fault."""
    degree = size * WAYS[way](np.linspace(0.0, 1.0, SAMPLES))
    (finding,) = said(fault, degree, seed).findings
    assert (fault, True) == (finding.fault.id, finding.active)
    return finding


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("fault", "size"), [("A.leakage", 0.4), ("B.clogging", 1.5), ("A.dp.high", 0.15)]
)
def test_the_degree_is_that_of_the_end(fault: str, size: float, way: str) -> None:
    """Its bounds hold the truth, and the truth's growth lies within those of the rate."""
    growth = growing(fault, way, size).growth
    assert growth is not None
    assert growth.rate is not None
    assert growth.grows
    assert growth.lower <= size <= growth.upper
    assert growth.upper - growth.lower < 0.25 * size
    share = np.linspace(0.0, 1.0, SAMPLES)
    true = size * float(np.diff(WAYS[way](share))[-1]) / 5.0
    assert growth.rate[1] <= true <= growth.rate[2]


def test_where_it_is_going() -> None:
    """A leakage that grew to 0.4 in an hour reaches 0.5, the next round one, a quarter later."""
    growth = growing("A.leakage", "linear", 0.4).growth
    assert growth is not None
    assert growth.reaches is not None
    end = 5.0 * (SAMPLES - 1)
    assert 0.5 == growth.reaches.degree
    assert growth.reaches.earliest <= 1.25 * end <= growth.reaches.latest
    assert growth.reaches.latest - growth.reaches.earliest < 0.2 * end


def test_a_meter_that_drifts_teaches_no_baseline() -> None:
    """A power meter with a bound of 10 W that goes off by 15 W within two hours."""
    degree = 0.15 * np.linspace(0.0, 1.0, SAMPLES)
    (finding,) = said("A.P_el.high", degree, 8402, interval=10.0).findings
    assert "A.P_el.high" == finding.fault.id
    assert finding.lower <= 0.15 <= finding.upper


@pytest.mark.parametrize("interval", [1.0, 10.0, 3600.0])
def test_nothing_grows_in_a_sound_plant(interval: float) -> None:
    """For minutes, hours, or a month."""
    for seed in range(5):
        assert "ok" == said("", np.zeros(SAMPLES), 8410 + seed, interval).status


def test_steps_stay_findings_of_their_own() -> None:
    """Each step has its degree; the last one says how it goes up."""
    degree = 0.1 * np.floor(4.99 * np.linspace(0.0, 1.0, SAMPLES))
    findings = said("A.leakage", degree, 8403).findings
    assert [0.1, 0.2, 0.3, 0.4] == [round(f.degree, 1) for f in findings]
    last = findings[-1].growth
    assert last is not None
    assert last.rate is not None
    assert not last.grows
    assert last.rate[1] <= 0.4 / (5.0 * SAMPLES) <= last.rate[2]
    assert [None] * 3 == [f.growth for f in findings[:-1]]


def test_a_fault_that_stays_does_not_grow() -> None:
    """Constant from the middle on: the rate may be none."""
    degree = np.where(np.arange(SAMPLES) > SAMPLES // 2, 0.3, 0.0)
    (finding,) = said("A.leakage", degree, 8404).findings
    growth = finding.growth
    assert growth is not None
    assert growth.rate is not None
    assert growth.rate[1] <= 0.0 <= growth.rate[2]
    assert ("", None) == (grown(finding), growth.reaches)


def test_told_in_words_as_json_and_as_a_picture() -> None:
    """The same numbers everywhere; a rate by the hour."""
    degree = 0.4 * np.linspace(0.0, 1.0, SAMPLES)
    diagnosis = said("A.leakage", degree, 8401)
    (finding,) = diagnosis.findings
    (form,) = diagnosis_form(diagnosis)["findings"]
    assert {"degree", "lower", "upper"} == form["now"].keys()
    assert form["degree"] == form["now"]["degree"]
    assert "1/h" == form["rate"]["unit"]
    assert 0.4 == pytest.approx(form["rate"]["value"], rel=0.05)
    assert {"degree", "earliest", "latest"} == form["reaches"].keys()
    words = grown(finding)
    assert "grows by" in words
    assert "reaches 50 % in" in words
    assert finding.growth is not None
    line = sparkline(finding.growth)
    assert list(line) == sorted(line)
    picture = draw_growth(diagnosis, finding)
    assert words in picture.caption
    assert "<svg" in picture.body
