"""What a search finds in tanks: faults that begin, laws left out, what has no name."""

import functools
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.mismatch import analyse, stores
from rulec.mismatch.answer.findings import findings_of, location_of
from rulec.mismatch.answer.verdict import verdict_of
from rulec.mismatch.answer.written_plant import NotComparable, written
from rulec.mismatch.evidence.stores import fit
from rulec.mismatch.evidence.stores.fit import plain_end, refit, sharpened
from rulec.mismatch.evidence.stores.fitted_curve import FittedCurve, fitted_curve
from rulec.mismatch.evidence.stores.model import model_of, period_of
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.result import Estimate
from rulec.mismatch.search import posterior as of_search
from rulec.mismatch.search import simulated
from rulec.mismatch.search.curve_by_simulation import curve_of
from rulec.mismatch.search.curve_found import CurveFound
from rulec.mismatch.search.grow_sets import prune
from rulec.mismatch.search.posterior import Posterior
from rulec.mismatch.search.simulated import begun, curves_of, likeliest_curve, search
from rulec.mismatch.stores import Explanation, _gained, explanation, prove, until_of
from tests.conftest import ROOT
from tests.runtime.mismatch.dynamic import problems
from tests.runtime.mismatch.dynamic.problems import (
    NOISE,
    OVERFLOW,
    RIM,
    TRUE,
    explained,
    grow_by,
    joined_to,
    made,
    problem_of,
    searched,
    tanks,
    voltage,
)
from tests.runtime.mismatch.made import changed

SINCE, DEGREE = 900.0, 0.15


def planted(fault: str) -> dict[str, float]:
    return {f"{fault}.x": DEGREE, f"{fault}.since": SINCE, f"{fault}.t_half": 1022.0}


@pytest.mark.parametrize("fault", ["lower.blockage", "upper.lost-inflow"])
def test_onset_and_degree_are_found(fault: str) -> None:
    problem = problem_of(made(n=512, seed=5, joined=(fault,), more=planted(fault)))
    grown = begun(problem)
    grow_by(grown, fault, "upper.area-slope@h")
    prune(grown, grown.likeliest)
    assert frozenset({fault}) == grown.likeliest
    plain = plain_end(problem, grown.models[frozenset()].setting.values)
    model = grown.models[frozenset({fault})].setting
    found = refit(plain, model.joined, {**model.values, **model.fixed})
    assert found.values[f"{fault}.since"] == pytest.approx(SINCE, abs=20.0)
    assert found.values[f"{fault}.x"] == pytest.approx(DEGREE, abs=0.03)


def test_a_strong_fault_is_as_sudden_as_it_was() -> None:
    """The rise that a search needs would shift its degree by many uncertainties."""
    fault, degree = "upper.blockage", 0.8
    sudden = {f"{fault}.x": degree, f"{fault}.since": SINCE + 1.0, f"{fault}.t_half": 20.0}
    problem = problem_of(made(n=2048, seed=4, joined=(fault,), more=sudden))
    plain, smooth = joined_to(problem, fault, {**sudden, f"{fault}.t_half": 4094.0})
    found = sharpened(smooth)
    assert found.values[f"{fault}.since"] == pytest.approx(SINCE + 1.0, abs=0.5)
    u = found.u(f"{fault}.x")
    assert abs(found.values[f"{fault}.x"] - degree) < 3.0 * u
    assert abs(smooth.values[f"{fault}.x"] - degree) > 10.0 * u
    assert found.gain(plain) > smooth.gain(plain)
    assert sharpened(plain) is plain  # what begins nowhere stays as it is


def test_what_is_adopted_knows_the_fault_but_does_not_hold_it() -> None:
    """Values are fitted to what lies before the fault, which is no part of the model."""
    fault = "lower.blockage"
    recording = made(n=512, seed=4, joined=(fault,), more=planted(fault))
    problem = problem_of(recording)
    plain, found = joined_to(problem, fault, planted(fault))
    said = explained(recording, plain, found)
    model = written(said, said.proofs(()))[0]
    adopted = model.repaired
    until = until_of(problem, found, [problem.candidate(fault)])
    assert found.values[f"{fault}.since"] == pytest.approx(until - problem.record.time[0])
    assert [fault] == [name for name, _ in model.left_out]
    assert adopted.joined == ()
    assert not any(name.startswith(fault) for name in (*adopted.free, *adopted.values))
    assert (len(adopted.free), len(adopted.free)) == adopted.covariance.shape
    assert adopted.values["lower.a"] == pytest.approx(TRUE["lower.a"], rel=0.1)


def test_a_period_is_told_in_the_time_of_the_recording() -> None:
    recording = made()
    problem = problem_of(replace(recording, time=recording.time + 5000.0))
    candidate = problem.candidate("lower.blockage")
    found = {
        "x": Estimate("", 15.0, 1.0, 13.0, 17.0, "%"),
        "since": Estimate("", SINCE, 4.0, SINCE - 8, SINCE + 8, "s"),
    }
    (period,) = period_of(problem, candidate, found)
    assert (5000.0 + SINCE, 5000.0 + 4.0 * 511) == (period.since, period.until)
    assert (0.15, 0.01) == (pytest.approx(period.degree), pytest.approx(period.u))


@pytest.mark.prove
def test_a_fault_that_does_the_same_is_told_beside() -> None:
    """Whether a pump delivers less or a line loses it, a level further down says nothing of it."""
    fault = "upper.lost-inflow"
    problem = problem_of(made(n=512, seed=4, joined=(fault,), more=planted(fault)))
    found = search(problem, lambda text: None)
    ids = {c.id for own in found.accepted for c in (own.candidate, *(c for c, _ in own.others))}
    assert {fault, "pump.leakage", "pump.u.high"} <= ids
    model = model_of(found.best)
    (finding,) = findings_of(model, found.accepted)
    locations = {"upper.inflow", "pump.pump", "pump.u"}
    assert locations - {f"{finding.module}.{finding.place}"} == {*location_of(model, finding).also}


def test_a_plant_that_runs_away_with_an_error_of_a_sensor_is_not_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Within its class an input may be higher than it reads, and fill what has no outflow."""

    def away(*_: object) -> None:
        raise RanAway

    monkeypatch.setattr(fit, "drift_of", away)
    monkeypatch.setattr(simulated, "explain", lambda problem, tell: begun(problem).posterior())
    said = stores.explain(made(200), *tanks(), (), lambda text: None)
    assert isinstance(said, NotComparable)
    assert "runs away" in said.why


LOST_FLOW = "upper.overflow-lost@inflow"


def test_a_sound_plant_is_recalibrated_to_its_noise() -> None:
    """Zero and gain of a sensor within its class are no physics."""
    recording = made(256, seed=3)
    y = recording.values["lower.y"] * 1.002 + 0.02
    found = search(problem_of(changed(recording, {"lower.y": y})), lambda text: None)
    (noise,) = found.plain.noise.values()
    assert not found.best.joined
    assert frozenset() == found.posterior.best
    assert noise.spread == pytest.approx(NOISE, rel=0.1)
    assert noise.correlation_time < 1.3


def test_a_law_is_found_although_its_special_case_fits() -> None:
    """An overflow that is caught holds one that is lost, and recalibration makes up for much."""
    found = begun(problem_of(made(joined=(OVERFLOW,), more=RIM)))
    grow_by(found, OVERFLOW, LOST_FLOW)
    own = frozenset({OVERFLOW})
    assert own == found.likeliest
    assert found.odds[own] > found.odds[frozenset({LOST_FLOW})] + 10.0
    values = found.models[own].setting.values
    assert values[f"{OVERFLOW}.f"] == pytest.approx(RIM[f"{OVERFLOW}.f"], abs=0.1)


@pytest.mark.prove
@pytest.mark.parametrize(
    ("built", "named", "more", "value", "off"),
    [
        # Recalibrated tanks that look slow are far from the plant as it is stated.
        ("pump.lag-flow@pump", "lag-flow", {"tau": 120.0}, "tau", 5.0),
        # A pump that follows no further at all has a strength at the end of its range.
        ("pump.pump-saturation@u", "pump.pump-saturation@u", {"c": 1.0, "s": 3.5}, "s", 0.05),
    ],
)
def test_what_recalibration_makes_up_for_is_named(
    built: str, named: str, more: dict[str, float], value: str, off: float
) -> None:
    own = {f"{built}.{name}": number for name, number in more.items()}
    found = search(problem_of(made(joined=(built,), more=own)), lambda text: None)
    (name,) = found.best.ids
    assert named in name
    assert abs(found.best.values[f"{name}.{value}"] - more[value]) < off


@pytest.fixture(scope="module")
def plain() -> Explanation:
    recording = made(256)
    problem = problem_of(recording)
    fitted = plain_end(problem, TRUE)
    return explained(recording, fitted, fitted)


def verdict(said: Explanation, off: float = 0.0) -> str:
    """With readings that are off by so much, V."""
    own = said.model.fitted
    moved = replace(own, errors={n: e + off for n, e in own.errors.items()})
    (proof,) = prove(own, moved)
    doubt = analyse._doubt(said, [proof.fit])
    return verdict_of((), False, doubt)


def test_a_sound_plant_gets_its_tick_and_none_where_more_is_left(plain: Explanation) -> None:
    """What no law within its accuracy explains is missing, whether it has a name or not."""
    assert plain.nothing > 0.9
    assert 5.0 * NOISE < plain.allowed["lower.y"] < 0.5
    said = [verdict(plain, share * plain.allowed["lower.y"]) for share in (0.0, 0.8, 1.5)]
    assert ["none", "none", "unsure"] == said


def test_a_reading_without_held_out_values_does_not_hide_the_others(plain: Explanation) -> None:
    fitted = plain.model.fitted
    (proof,) = prove(fitted, replace(fitted, errors={n: 2 * e for n, e in fitted.errors.items()}))
    nothing = replace(proof.fit.heldout, recalibrated=np.nan, repaired=np.nan, points=0)
    blind = replace(proof, fit=replace(proof.fit, heldout=nothing))
    assert _gained(fitted, [blind, proof]) == _gained(fitted, [proof]) < -10.0
    assert np.inf == _gained(fitted, [blind])


@pytest.mark.parametrize(("more", "expected"), [(-3.0, "none"), (0.0, "unsure")])
def test_no_tick_where_an_explanation_gains(
    plain: Explanation, more: float, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    was = plain.found.posterior
    none, other = frozenset[str](), frozenset({"pump.x"})
    shown: Any = SimpleNamespace(terms=())
    monkeypatch.setattr(
        of_search, "Tolerance", lambda evidence, model: SimpleNamespace(shows=1.0, tolerated=none)
    )
    odds = {none: was.odds[none], other: was.odds[none] + more}
    now = Posterior(was.evidence, {**was.models, other: shown}, odds)
    found = replace(plain.found, posterior=now)
    assert expected == verdict(explanation(plain.recording, plain.model, found))


LOSS = "lower.store-loss@inflow"


def test_a_flow_that_no_entry_names_follows_what_it_follows() -> None:
    """A jet that misses the first tank at high flow: a flow from tank to tank, as the pump runs."""
    missed = 0.6 * TRUE["pump.k"] * np.maximum(voltage(384, 1) - 3.0, 0.0)
    problem = problem_of(made(384, errors={"definition:upper.outflow": missed}))
    unnamed = likeliest_curve(searched(problem, LOSS))
    assert unnamed.curve.driver == "pump.u"
    assert unnamed.curve.location.module in ("upper", "lower")
    assert unnamed.share > 1.0 - 0.7**2


def test_a_reading_that_no_entry_names_is_a_curve_for_a_plant_file() -> None:
    """A bump of a transmitter's characteristic, drawn over the level with a few points."""
    level = made(384).values["lower.y"]
    middle = float(np.median(level))
    bump = 0.6 * np.exp(-(((level - middle) / 0.7) ** 2))
    problem = problem_of(made(384, errors={"reading:lower.y": bump}))
    (curve,) = curves_of(searched(problem, LOSS))
    assert ("reading:lower.y", "lower.h") == (curve.place, curve.driver)
    h, shown = np.array(curve.points).T
    assert h[np.argmax(shown)] == pytest.approx((middle - TRUE["lower.y0"]) / TRUE["lower.g"], 0.05)
    assert max(shown) - 0.5 * (shown[0] + shown[-1]) == pytest.approx(0.6, abs=0.15)


@pytest.mark.parametrize("holds", [True, False])
def test_a_curve_that_gains_nothing_where_it_was_not_drawn_is_no_mismatch(
    monkeypatch: pytest.MonkeyPatch, holds: bool
) -> None:
    missed = 0.6 * TRUE["pump.k"] * np.maximum(voltage(384, 1) - 3.0, 0.0)
    recording = made(384, errors={"definition:upper.outflow": missed})
    found = searched(problem_of(recording), LOSS)
    unnamed = likeliest_curve(found)
    monkeypatch.setattr(simulated.Found, "has_unnamed", True)
    monkeypatch.setattr(stores, "search", lambda problem, tell: found)
    drawn = unnamed if holds else replace(unnamed, fitted=found.plain)
    monkeypatch.setattr(stores, "likeliest_curve", lambda found: drawn)
    said = stores.explain(recording, *tanks(), (), lambda text: None)
    assert isinstance(said, Explanation)
    assert (holds, not holds) == (bool(said.locations), bool(said.dropped))


SAMPLES = 640
FLAP = "lower.sticking-flap@outflow"
HELD_BACK, NEAR, WIDE = 0.3, 0.10, 0.025
EFFECT = """
effect: sticking-flap
title: Flap that sticks at some level
sort: physics
joins:
  - {flows: out, law: law*(1 - w*exp(-((l - l0)/d)**2))}
drivers:
  l: {quantity: level}
parameters:
  w:  {unit: "%", null: 0, starts: [10], range: [-100, 100],
       usual: {median: 10, factor: 3, source: "[assumed]"}, title: share held back}
  l0: {unit: cm, starts: [10], range: [1, 40], title: level}
  d:  {unit: cm, starts: [2], range: [0.5, 10], title: width}
regime: some levels
text: "{module}: {w} of what flows out is held back near {l0}, {d}"
action: mend the flap
source: "[assumed]"
"""


@functools.cache
def flapping(seed: int) -> SimulationProblem:
    """Of a recording with a flap, which the catalogue lacks."""
    values = {f"{FLAP}.w": HELD_BACK, f"{FLAP}.l0": NEAR, f"{FLAP}.d": WIDE}
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        kb = shutil.copytree(ROOT / "kb", Path(folder) / "kb")
        (kb / "effects" / "sticking-flap.yaml").write_text(EFFECT.lstrip(), encoding="utf-8")
        patch.setenv("RULEC_KB", str(kb))
        patch.setattr(problems, "tanks", tanks.__wrapped__)
        recording = made(SAMPLES, seed, joined=(FLAP,), more=values)
    return problem_of(recording)


def left_out(curve: CurveFound, found: FittedCurve) -> Array:
    """What the plain law leaves out, SI, in a model with its scale of the level: all that a sensor
    of unknown gain and zero says of it is what it shows."""
    values = found.fitted.values
    gain, zero, area = (values[f"lower.{name}"] for name in ("g", "y0", "A"))
    shown = curve.at
    level = (shown - TRUE["lower.y0"]) / TRUE["lower.g"]
    flow = TRUE["lower.a"] * np.sqrt(2.0 * 9.81 * level)
    flow *= 1.0 - HELD_BACK * np.exp(-(((level - NEAR) / WIDE) ** 2))
    flow *= (area * TRUE["lower.g"]) / (TRUE["lower.A"] * gain)
    law = values["lower.a"] * np.sqrt(2.0 * 9.81 * np.maximum((shown - zero) / gain, 0.0))
    off: Array = flow - law
    return off


@pytest.mark.parametrize("seed", [1, 2])
def test_the_true_curve_lies_in_the_band(seed: int) -> None:
    """Over what was shown, with and without its level: the whole curve, by chi-square."""
    problem = flapping(seed)
    plain = plain_end(problem, {})
    location = next(s for s in problem.builder.locations if s.id == "definition:lower.outflow")
    term = fitted_curve(plain, location, "lower.h")
    curve = curve_of(term)
    assert "lower.y" == curve.driver
    off = curve.value - left_out(curve, term)
    less = np.eye(len(off)) - 1.0 / len(off)
    u = np.sqrt(np.diag(less @ curve.covariance @ less))
    # A curve of some eight independent values: 99 of 100 are within this, by chi-square.
    assert np.sqrt(np.mean(off**2 / np.diag(curve.covariance))) < np.sqrt(20.1 / 8.0)
    assert np.sqrt(np.mean((less @ off / u) ** 2)) < np.sqrt(20.1 / 8.0)
    # And the band says something: the bump is many times as high.
    assert np.ptp(curve.value) > 5.0 * float(np.median(u))


OUTLET_LAW = "lower.outlet-exponent@outflow"


def test_place_and_driver_are_found() -> None:
    """Among all places and all that they may follow; no curve is drawn through noise."""
    assert likeliest_curve(searched(problem_of(made(SAMPLES, 1)), OUTLET_LAW)) is None
    unnamed = likeliest_curve(searched(flapping(1), OUTLET_LAW))
    curve = unnamed.curve
    # What flows out is all that its balance loses, so these two are the same.
    assert f"{curve.location.module}.{curve.location.place}" in ("lower.outflow", "lower.h")
    assert "lower.y" == curve.driver
    assert unnamed.share > 0.9
    assert abs(curve.branches.gap) < 0.05 * float(np.ptp(curve.value))
    (lost,) = curve.lost
    assert "outlet-exponent" == lost.candidate.name
    assert lost.nats > 100.0
