"""Reverse flow, a pump against a closed way, a pump that runs dry."""

import io

import numpy as np
import pytest
from rich.console import Console
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.report.html_findings import told
from rulec_runtime.report.json_form import diagnosis_form
from rulec_runtime.report.terminal_findings import explain
from rulec_runtime.report.verdict import verdict

from rulec.prove.truth.units import BAR, LITRE_PER_HOUR
from tests.dosing import INSIDE, Operation, Run, record
from tests.method.readings import built, calibrated, recording, ruleset
from tests.rig.long_run.physics import idle

HOLD = 60
"""Samples of each half of a recording, s."""

OPEN = 5.0e-6 * BAR / LITRE_PER_HOUR**2
"""A standing pump that lets 141 l/h back at 0.1 bar."""

TIGHT = 1.0e3 * BAR / LITRE_PER_HOUR**2
"""One that lets nothing through."""


def said(
    rig: str,
    module: str,
    seed: int,
    *,
    speed: float = 1.0,
    passage: float = TIGHT,
    dry: bool = False,
    closed: float = 0.0,
) -> Diagnosis:
    """A module, sound in the first half, at a share of its nominal speed in the second."""
    plant, rules = built(rig), calibrated(ruleset(rig))
    later = np.arange(2 * HOLD) >= HOLD
    speeds = {name: np.full(later.size, part.speed) for name, part in plant.modules.items()}
    speeds[module] = np.where(later, speed, 1.0) * speeds[module]
    plant = idle(plant, module, later & (dry or speed == 0.0), passage)
    operation = Operation(np.arange(2.0 * HOLD), speeds)
    faults = {f"{module}.clogging": closed * later}
    readings = record(Run(plant, operation, faults, backflow=True), INSIDE, seed).readings
    return diagnose(recording(rules, readings), rules)


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
        ("abc", "A", {"speed": 0.3, "closed": 1.0e5}, "dead-heading"),
        ("mixing-rig", "A", {"speed": 0.3, "closed": 1.0e5}, "dead-heading"),
    ],
)
def test_a_regime_is_told_and_no_other(
    rig: str, module: str, how: dict[str, float], regime: str
) -> None:
    for seed in range(2):
        found = said(rig, module, seed, **how)  # type: ignore[arg-type]
        assert {r.regime.id for r in found.regimes} == ({f"{module}.{regime}"} if regime else set())
        if regime == "reverse-flow":
            assert HOLD <= found.regimes[0].since <= HOLD + 5
            assert found.regimes[0].active
            assert found.status in ("S", "C")


def test_sound_plants_run_in_no_regime() -> None:
    for seed in range(10):
        for speed in (1.0, 0.5):
            assert not said("mixing-rig", "C", 100 + seed, speed=speed).regimes


def test_a_regime_is_told_on_terminal_page_and_in_data() -> None:
    found = said("abc", "A", 1, speed=0.0, passage=OPEN)
    (regime,) = diagnosis_form(found)["regimes"]
    assert ("A.reverse-flow", "A", True) == (regime["regime"], regime["module"], regime["active"])
    assert ["dp > 0", "loss < 0"] == [e["condition"] for e in regime["evidence"]]
    assert all(e["sigma"] > 3.0 for e in regime["evidence"])
    text = io.StringIO()
    explain(Console(file=text, width=200), found)
    for page in (text.getvalue(), told(found)):
        assert "liquid runs back through it" in page
        assert "close a valve between pump and junction" in page
    assert verdict(found).startswith("Liquid runs back in A")
