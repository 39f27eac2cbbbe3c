"""A liquid that gets cold: one cause in all modules at once, told as such and not as clogging."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from rulec_runtime.contract.ruleset_file import parse_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady.parts import parts_of
from rulec_runtime.diagnosis.trace import trace

from rulec.prove.truth import INSIDE, Operation, Plant, Run, record
from rulec.prove.truth.faults import Faults
from rulec.prove.truth.plant import LIQUID_TEMPERATURE
from rulec.prove.truth.pumps import Displacement
from tests.conftest import ROOT
from tests.method.readings import built, calibrated, recording, ruleset

HOLD = 60
"""Samples of each half of a recording, s."""

MIXERS = {"abc": "C", "mixing-rig": "M1"}
RIGS = sorted(MIXERS)


def thicker_run(
    plant: Plant,
    later: NDArray[np.bool_],
    friction: float,
    slip: float,
    cooled: float,
    faults: Faults,
) -> Run:
    """Run at nominal speed; while `later`, shape (n,), friction losses and slips are multiplied by
    factors, and the liquid is colder by `cooled`, K. Parameters become arrays.

    Source: the factors are independent, as a plant has laminar and turbulent paths.
    """
    rubbed: Any = np.where(later, friction, 1.0)
    slipped: Any = np.where(later, slip, 1.0)
    modules = {}
    for name, module in plant.modules.items():
        pump = module.pump
        if isinstance(pump, Displacement):
            parts = ("slip", "slip_per_speed", "slip_linear", "slip_quadratic")
            pump = replace(pump, **{part: getattr(pump, part) * slipped for part in parts})
        line = replace(module.line, quadratic=module.line.quadratic * rubbed)
        modules[name] = replace(module, pump=pump, line=line)
    mixers = {n: replace(m, quadratic=m.quadratic * rubbed) for n, m in plant.mixers.items()}
    speeds = {name: np.full(later.size, module.speed) for name, module in modules.items()}
    warmth = LIQUID_TEMPERATURE - np.where(later, cooled, 0.0)
    time = np.arange(later.size, dtype=np.float64)
    operation = Operation(time, speeds, temperature=dict.fromkeys(modules, warmth))
    return Run(replace(plant, modules=modules, mixers=mixers), operation, faults)


def said(
    rig: str,
    seed: int,
    *,
    friction: float = 1.15,
    slip: float = 0.8,
    cooled: float = 0.0,
    faults: dict[str, float] | None = None,
) -> Diagnosis:
    """What is said where the liquid changes in the second half; without a change pass ones."""
    plant, rules = built(rig), calibrated(ruleset(rig))
    later = np.arange(2 * HOLD) >= HOLD
    degrees = {name: degree * later for name, degree in (faults or {}).items()}
    run = thicker_run(plant, later, friction, slip, cooled, degrees)
    return diagnose(recording(rules, record(run, INSIDE, seed).readings), rules)


def named(found: Diagnosis) -> set[str]:
    """Faults that are named."""
    return {f.fault.id for f in found.findings}


@pytest.mark.parametrize("rig", RIGS)
def test_a_cold_liquid_is_no_clogging(rig: str) -> None:
    """Friction +15 %, slip -20 % everywhere: the viscosity, from when it changed, and it alone."""
    for seed in range(5):
        found = said(rig, seed)
        (finding,) = found.findings
        assert "liquid.viscosity.high" == finding.fault.id
        assert HOLD <= finding.since <= HOLD + 5
        assert "S" == found.status
        # A quarter power of the viscosity gives friction +15 % at 75 % more of it.
        assert finding.lower < 1.15**4 - 1.0 < finding.upper


@pytest.mark.parametrize("rig", RIGS)
def test_a_warm_liquid_is_thinner(rig: str) -> None:
    """Friction -13 %, slip +25 %."""
    for seed in range(3):
        assert {"liquid.viscosity.low"} == named(said(rig, seed, friction=0.87, slip=1.25))


def test_what_the_weather_makes_is_a_remark() -> None:
    """A liquid thicker by a fifth, as 7 K make it: told, and no finding."""
    found = said("abc", 0, friction=1.2**0.125**2, slip=1.2**-0.7)
    assert ("ok", ()) == (found.status, found.findings)
    assert any("the liquid is thicker" in note and "weather" in note for note in found.notes)


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("kind", ["clogging", "leakage", "P_el.high"])
def test_what_one_module_has_is_not_the_liquid(rig: str, kind: str) -> None:
    """Named, and the liquid no alternative to it."""
    fault = f"{MIXERS[rig] if kind == 'clogging' else 'A'}.{kind}"
    for seed in range(3):
        found = said(rig, seed, friction=1.0, slip=1.0, faults={fault: 0.2})
        assert {fault} == named(found)
        (finding,) = found.findings
        others = {name for name, _ in (*finding.alternatives, *finding.remote)}
        assert not any(name.startswith("liquid.") for name in others)


@pytest.mark.parametrize("rig", RIGS)
def test_two_cloggings_are_not_the_liquid(rig: str) -> None:
    """A change of all lines with a tolerance comes near two that changed; two come nearer."""
    for seed in range(3):
        faults = {"A.clogging": 0.3, f"{MIXERS[rig]}.clogging": 0.3}
        assert set(faults) == named(said(rig, seed, friction=1.0, slip=1.0, faults=faults))


@pytest.mark.parametrize("rig", RIGS)
def test_a_leakage_is_seen_beside_a_cold_liquid(rig: str) -> None:
    """Both are named, with the degree of the leakage."""
    for seed in range(3):
        found = said(rig, seed, faults={"A.leakage": 0.2})
        assert {"A.leakage", "liquid.viscosity.high"} == named(found)
        leak = next(f for f in found.findings if f.fault.id == "A.leakage")
        assert leak.lower - 0.01 < 0.2 < leak.upper + 0.01


def test_temperatures_that_moved_are_told_and_count() -> None:
    """One that fell as the change needs speaks for it, one that stayed speaks against."""
    fell, stayed = (said("abc", 1, cooled=cooled).findings[0] for cooled in (15.0, 0.0))
    assert "2 temperatures fell by 15 K, which speaks for it" in fell.text
    assert "2 temperatures stayed within 0.5 K, which speaks against it" in stayed.text


def test_sound_plants_say_nothing() -> None:
    """Twenty sets of sensor errors within their bounds."""
    for seed in range(20):
        found = said("mixing-rig", 500 + seed, friction=1.0, slip=1.0)
        assert ("ok", (), ()) == (found.status, found.findings, found.unknown)


def test_a_trace_names_the_liquid() -> None:
    """Sample by sample; faults of modules have the columns."""
    rules = calibrated(ruleset("abc"))
    later = np.arange(2 * HOLD) >= HOLD
    readings = record(thicker_run(built("abc"), later, 1.15, 0.8, 0.0, {}), INSIDE, 1).readings
    words = trace(recording(rules, readings), rules).verdict
    assert "ok" == words[HOLD // 2]
    assert "liquid.viscosity.high" == words[-2]


def test_the_ruleset_reads_back_and_plants_of_one_module_know_no_liquid() -> None:
    """There it is what faults of that module are."""
    abc = ruleset("abc")
    assert abc.liquid == parse_ruleset(json.loads(abc.to_json())).liquid
    assert ["liquid.viscosity.high", "liquid.viscosity.low"] == [c.fault.id for c in abc.liquid]
    assert () == ruleset("zema-hydraulic").liquid


def test_without_a_change_estimates_are_as_without_the_liquid() -> None:
    """At degree 0 the plan with the liquid undone is the plan."""
    rules = ruleset("mixing-rig")
    names = [n for n in rules.undo.outputs if n.startswith("ql:")]
    inputs = {n: 0.0 for n in rules.undo.inputs if n.startswith("x:")}
    readings = {s.id: s.reference for s in rules.signals if s.id in rules.undo.inputs}
    found = rules.undo.run({**inputs, **readings})
    assert len(names) == 15
    for name in names:
        assert np.ravel(found[name]) == pytest.approx(np.ravel(found[name.replace("ql:", "q:")]))
    (part,) = parts_of(rules)
    assert part.ruleset.faults[-1].id == "liquid.viscosity.low"


def test_its_laws_are_those_of_the_effects() -> None:
    """The exponents stand in the files of slip and line by viscosity, as usual sizes."""
    fault = yaml.safe_load((ROOT / "kb/faults/changed-viscosity.yaml").read_text(encoding="utf-8"))
    for name, move in zip(("slip-viscosity", "line-viscosity"), fault["moves"], strict=True):
        effect = yaml.safe_load((ROOT / f"kb/effects/{name}.yaml").read_text(encoding="utf-8"))
        exponent = effect["parameters"]["m"]["usual"]["median"]
        law = effect["joins"][0]["law"].replace("dp", "by").replace("mu/mu0", "r")
        assert move["law"] == law.replace("m*log", f"{exponent:g}*log")
