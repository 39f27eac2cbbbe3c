"""The measuring of the rig: figures of a small run, and that the counting itself is right."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from rulec.prove.truth import RIGS, published_faults
from tests.rig.mixing_rig.cases import EXPERIMENTS, FULL, PUMPS, QUICK
from tests.rig.mixing_rig.goals import GOALS
from tests.rig.mixing_rig.judge import Answer, Judged, Named
from tests.rig.mixing_rig.measure import (
    ROWS,
    alarm_figures,
    degree_figures,
    figure_11,
    grouped,
    isolation_figures,
    kind_of,
    pair_figures,
    sample_figures,
)
from tests.rig.mixing_rig.run import run
from tests.rig.mixing_rig.show import SHOW, show_goals


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Judged]:
    """Every experiment, small."""
    folder: Path = tmp_path_factory.mktemp("rulesets")
    return {name: run(folder, make(QUICK), workers=1) for name, make in EXPERIMENTS.items()}


def answer(true: dict[str, float], *named: Named, unknown: bool = False) -> Answer:
    """An answer by hand."""
    return Answer("abc", "by hand", "default", 1, next(iter(true.values())), true, named, unknown)


def named(fault: str, degree: float, probability: float = 1.0, *alternatives: str) -> Named:
    """A finding by hand, bounds 0.05 to either side."""
    return Named(fault, degree, degree - 0.05, degree + 0.05, probability, alternatives)


RIGHT = answer({"A.leakage": 0.2}, named("A.leakage", 0.21))
OFF = answer({"A.leakage": 0.4}, named("A.leakage", 0.3, 0.6, "B.dp.low"))
WRONG = answer({"A.leakage": 0.8}, named("B.leakage", 0.5, 0.99))
SECOND = answer({"A.leakage": 0.8}, named("B.leakage", 0.5, 0.99, "A.leakage"))
UNKNOWN = answer({"A.leakage": 0.1}, unknown=True)
SILENT = answer({"A.leakage": 0.1})
ALL = [RIGHT, OFF, WRONG, SECOND, UNKNOWN, SILENT]


def test_degrees_are_counted_rightly() -> None:
    """Errors of what is named rightly; wrong, unknown and silent points counted apart."""
    found = degree_figures(ALL)
    counts = (found.points, found.right, found.wrong, found.unknown, found.silent)
    assert (6, 2, 2, 1, 1) == counts
    expected = (0.055, -0.045, 0.1775, 0.5, 0.1)
    figures = (found.error, found.bias, found.error_any, found.covered, found.width)
    assert expected == pytest.approx(figures)


def test_isolation_is_counted_rightly() -> None:
    """A set of two causes counts a half; to be sure of the wrong fault is counted."""
    found = isolation_figures(ALL)
    expected = (2 / 6, 3 / 6, 2 / 6, 1 / 6, 0.0, 1 / 6, 1 / 6)
    figures = (found.first, found.possible, found.shared, found.certain_wrong, found.extra)
    assert expected == pytest.approx((*figures, found.unknown, found.silent))


def test_pairs_are_counted_rightly() -> None:
    """Both, one, none of two true faults."""
    true = {"A.leakage": 0.2, "B.clogging": 0.3}
    leak, clog, other = named("A.leakage", 0.3), named("B.clogging", 0.3), named("C.clogging", 0.2)
    sets = [(leak, clog), (clog, other), (other,), ()]
    found = pair_figures([answer(true, *some) for some in sets])
    assert (0.25, 0.25, 0.25, 0.0, 0.25) == (
        found.both, found.one, found.wrong, found.unknown, found.silent
    )  # fmt: skip
    assert 0.05 == pytest.approx(found.error)


def test_figure_11_holds_what_is_named_rightly() -> None:
    """Shares add up to one; the cases stand at their discrepancy and degree."""
    table = figure_11(ALL)
    assert 1.0 == pytest.approx(table.sum())
    assert 0.5 == table[ROWS.index(0.0), 1] == table[ROWS.index(-0.1), 2]


def test_kinds_of_faults() -> None:
    """The rig has 7 kinds for each of 3 pumps and 4 for mixers; every module is known."""
    faults = published_faults(RIGS["mixing-rig"]())
    answers = [Answer("mixing-rig", "", "", 0, 0.1, {f: 0.1}, (), False) for f in faults]
    assert 25 == len(grouped(answers, kind_of))
    for plant, pumps in PUMPS.items():
        rig = RIGS[plant]()
        assert [*rig.modules, *rig.mixers] == list(pumps)


def test_size_of_the_full_run() -> None:
    """At least 1200 stationary points of all faults, and 100,000 fault-free samples."""
    degrees, alarms = (EXPERIMENTS[name](FULL) for name in ("degrees", "alarms"))
    points = sum(len(task.plateaus) for task in degrees)
    healthy = sum(task.case.run.operation.time.size for task in alarms)
    assert (1376, 100_000) == (points, healthy)
    seeds = [task.case.seed for task in [*degrees, *alarms]]
    assert len(seeds) == len(set(seeds))


def test_leakage_is_measured(quick: dict[str, Judged]) -> None:
    """Default mode names every plateau of both plants, within 0.02 and unlike the paper's mode."""
    for plant in PUMPS:
        answers = [a for a in quick["leakage"].answers if a.group == plant]
        default = degree_figures([a for a in answers if a.mode == "default"])
        assert (3, 3) == (default.points, default.right)
        assert default.error < 0.02
        samples = [s for s in quick["leakage"].samples if s.group == plant]
        modes = {s.mode: sample_figures([s], "A.leakage") for s in samples}
        assert 0.0 == modes["default"].alarmed
        assert modes["paper, no gate"].bias < -0.01


def test_healthy_rig_is_healthy(quick: dict[str, Judged]) -> None:
    """No sample of a tour with transients is called faulty in default mode."""
    found = quick["alarms"]
    covered = [c for c in found.covered if c.mode == "default"]
    figures = alarm_figures(covered, [s for s in found.samples if s.mode == "default"])
    assert (80, 0, 0, ()) == (figures.samples, figures.fault, figures.unknown, figures.named)


def test_every_fault_answered_in_both_modes(quick: dict[str, Judged]) -> None:
    """Each plateau has one answer per mode; true degrees are what was set, to a valve's lag."""
    answers = quick["degrees"].answers
    tasks = EXPERIMENTS["degrees"](QUICK)
    assert [t.case.seed for t in tasks for _ in t.modes] == [a.case for a in answers]
    for one in answers:
        assert [one.set_degree] == pytest.approx(list(one.true.values()), rel=0.3)
    assert np.isfinite(degree_figures(answers).error)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_figures_can_be_shown(name: str, quick: dict[str, Judged]) -> None:
    """Every table prints."""
    out = Console(width=150, record=True, file=io.StringIO())
    SHOW[name](out, quick[name])
    show_goals(out, GOALS[name](quick[name]) if name in GOALS else [])
    assert len(out.export_text().splitlines()) > 3
