"""Reverse flow, a closed way, a pump that runs dry; a cold liquid: one cause in all modules."""

from typing import Any

import numpy as np
import pytest
import yaml
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.recording import Recording

from rulec.prove.truth.units import BAR, LITRE_PER_HOUR
from tests.conftest import ROOT
from tests.dosing import INSIDE, Operation, Run, record
from tests.dosing.plant import LIQUID_TEMPERATURE
from tests.method.readings import built, calibrated, recording, ruleset
from tests.rig.long_run.plants import SLIP, idle, scaled

DWELL = 60
"""Samples of each half of a recording, s."""

OPEN = 5.0e-6 * BAR / LITRE_PER_HOUR**2
"""A standing pump that lets 141 l/h back at 0.1 bar."""

TIGHT = 1.0e3 * BAR / LITRE_PER_HOUR**2
"""One that lets nothing through."""


def recorded(
    rig: str,
    seed: int,
    friction: float = 1.0,
    slip: float = 1.0,
    cooled: float = 0.0,
    *,
    module: str = "A",
    speed: float = 1.0,
    passage: float = TIGHT,
    dry: bool = False,
    **degrees: float,
) -> Recording:
    """At nominal speed. In the second half friction and slip change by factors (of their own, as a
    plant has laminar and turbulent paths), the liquid is colder, K, a module runs at a share of its
    speed, or dry, and there are faults."""
    later = np.arange(2 * DWELL) >= DWELL
    plant = scaled(built(rig), (".k2",), np.where(later, friction, 1.0))
    plant = scaled(plant, SLIP, np.where(later, slip, 1.0))
    speeds = {name: np.full(later.size, part.speed) for name, part in plant.modules.items()}
    speeds[module] = np.where(later, speed, 1.0) * speeds[module]
    plant = idle(plant, module, later & (dry or speed == 0.0), passage)
    warmth = dict.fromkeys(speeds, LIQUID_TEMPERATURE - np.where(later, cooled, 0.0))
    operation = Operation(np.arange(2.0 * DWELL), speeds, temperature=warmth)
    faults = {name.replace("_", ".", 1): degree * later for name, degree in degrees.items()}
    made = record(Run(plant, operation, faults, backflow=True), INSIDE, seed)
    return recording(calibrated(ruleset(rig)), made.readings)


def said(rig: str, seed: int, *change: float, **how: Any) -> Diagnosis:
    return diagnose(recorded(rig, seed, *change, **how), calibrated(ruleset(rig)))


@pytest.mark.parametrize(
    ("rig", "module", "how", "regime"),
    [
        ("abc", "A", {"speed": 0.0, "passage": OPEN}, "reverse-flow"),
        ("mixing-rig", "D", {"speed": 0.0, "passage": OPEN}, "reverse-flow"),
        # The line of a tight one loses nothing; pressures of the junction stand in front of it.
        ("abc", "A", {"speed": 0.0}, ""),
        ("mixing-rig", "E", {"speed": 0.0}, ""),
        # Beside whatever fault it looks like to the estimates.
        ("abc", "B", {"dry": True}, "dry-running"),
        ("mixing-rig", "E", {"dry": True}, "dry-running"),
        # At a third of its speed, where its slip at a pressure within the sensor's range takes all.
        ("abc", "A", {"speed": 0.3, "A_clogging": 1.0e5}, "dead-heading"),
        ("mixing-rig", "A", {"speed": 0.3, "A_clogging": 1.0e5}, "dead-heading"),
    ],
)
def test_a_regime_is_told_and_no_other(
    rig: str, module: str, how: dict[str, float], regime: str
) -> None:
    for seed in range(2):
        found = said(rig, seed, module=module, **how)
        assert {r.regime.id for r in found.regimes} == ({f"{module}.{regime}"} if regime else set())
        if regime == "reverse-flow":
            assert DWELL <= found.regimes[0].since <= DWELL + 5
            assert found.regimes[0].active
            assert found.status in ("S", "C")


def test_sound_plants_run_in_no_regime_and_say_nothing() -> None:
    for seed in range(10):
        assert not said("mixing-rig", 100 + seed, module="C", speed=0.5).regimes
        found = said("mixing-rig", 100 + seed)
        assert ("ok", (), (), ()) == (found.status, found.findings, found.unknown, found.regimes)


MIXERS = {"abc": "C", "mixing-rig": "M1"}
COLD = (1.15, 0.8)
"""Friction +15 %, slip -20 %."""

RIGS = pytest.mark.parametrize("rig", MIXERS)


def named(found: Diagnosis) -> set[str]:
    return {f.fault.id for f in found.findings}


@RIGS
def test_a_cold_liquid_is_no_clogging_and_a_warm_one_is_thinner(rig: str) -> None:
    for seed in range(2):
        found = said(rig, seed, *COLD)
        (finding,) = found.findings
        assert ("S", "liquid.viscosity.high") == (found.status, finding.fault.id)
        assert DWELL <= finding.since <= DWELL + 5
        # A quarter power of the viscosity gives friction +15 % at 75 % more of it.
        assert finding.lower < 1.15**4 - 1.0 < finding.upper
    assert {"liquid.viscosity.low"} == named(said(rig, 0, 0.87, 1.25))


@RIGS
def test_what_modules_have_is_not_the_liquid(rig: str) -> None:
    """A change of all lines comes near two cloggings; two come nearer."""
    clogged = f"{MIXERS[rig]}_clogging"
    for fault in (clogged, "A_leakage", "A_P_el.high"):
        found = said(rig, 0, **{fault: 0.2})
        (finding,) = found.findings
        assert fault.replace("_", ".", 1) == finding.fault.id
        others = {name for name, _ in (*finding.alternatives, *finding.remote)}
        assert not any(name.startswith("liquid.") for name in others)
    for seed in range(2):
        both = said(rig, seed, **{"A_clogging": 0.3, clogged: 0.3})
        assert {"A.clogging", clogged.replace("_", ".")} == named(both)


@RIGS
def test_a_leakage_is_seen_beside_a_cold_liquid(rig: str) -> None:
    for seed in range(2):
        found = said(rig, seed, *COLD, A_leakage=0.2)
        assert {"A.leakage", "liquid.viscosity.high"} == named(found)
        leak = next(f for f in found.findings if f.fault.id == "A.leakage")
        assert leak.lower - 0.01 < 0.2 < leak.upper + 0.01


def test_remarks() -> None:
    """A liquid thicker by a fifth, as 7 K make it; a temperature speaks for or against."""
    found = said("abc", 0, 1.2**0.125**2, 1.2**-0.7)
    assert ("ok", ()) == (found.status, found.findings)
    assert any("the liquid is thicker" in note and "weather" in note for note in found.notes)
    fell, stayed = (said("abc", 1, *COLD, cooled).findings[0] for cooled in (15.0, 0.0))
    assert "2 temperatures fell by 15 K, which speaks for it" in fell.text
    assert "2 temperatures stayed within 0.5 K, which speaks against it" in stayed.text


def test_a_trace_names_the_liquid() -> None:
    words = trace(recorded("abc", 1, *COLD), calibrated(ruleset("abc"))).verdict
    assert ("ok", "liquid.viscosity.high") == (words[DWELL // 2], words[-2])


def test_its_laws_are_those_of_the_effects() -> None:
    """The exponents stand in the files of slip and line by viscosity, as usual sizes."""
    fault = yaml.safe_load((ROOT / "kb/faults/changed-viscosity.yaml").read_text(encoding="utf-8"))
    for name, move in zip(("slip-viscosity", "line-viscosity"), fault["moves"], strict=True):
        effect = yaml.safe_load((ROOT / f"kb/effects/{name}.yaml").read_text(encoding="utf-8"))
        exponent = effect["parameters"]["m"]["usual"]["median"]
        law = effect["joins"][0]["law"].replace("dp", "by").replace("mu/mu0", "r")
        assert move["law"] == law.replace("m*log", f"{exponent:g}*log")
