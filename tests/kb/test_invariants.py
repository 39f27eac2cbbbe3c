"""What must hold for every module type: invariant x plant, at the reference point and off it.

A new module type gets all of this for free: it only needs a plant below.
"""

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.passes.pipeline import compile_plant
from tests.written import write_plant

PLANTS = {
    "abc": {"A": "dosing-pcp", "B": "dosing-pcp", "C": "static-mixer"},
    "membrane": {"A": "dosing-membrane", "B": "dosing-pcp", "C": "static-mixer"},
    "centrifugal": {"A": "dosing-centrifugal", "B": "dosing-membrane", "C": "static-mixer"},
    "pump set": {"A": "pump-set"},
    "warm pump set": {"A": "pump-set-warm"},
    "waste water": {"A": "grundfos-s3-145", "B": "grundfos-s3-120", "C": "discharge-channel"},
    "oil pump set": {"A": "pump-set-oil"},
    "multistage": {"A": "multistage-centrifugal"},
    "warm": {"A": "dosing-pcp-warm", "B": "dosing-pcp-warm", "C": "straight-pipe"},
}


@pytest.fixture(scope="module", params=sorted(PLANTS))
def ruleset(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Ruleset:
    """A small plant of some module types."""
    modules, folder = PLANTS[request.param], tmp_path_factory.mktemp("plant")
    connections = "A -> C, B -> C" if "C" in modules else ""
    return compile_plant(write_plant(folder, modules, connections, fluid="meg-30"))


def _reference(ruleset: Ruleset) -> dict[str, float]:
    return {s.id: s.reference for s in ruleset.signals}


def _scatter(ruleset: Ruleset, share: float) -> dict[str, float]:
    """Readings off the reference point, each by its own fixed share."""
    return {
        s.id: s.reference * (1 + share * np.sin(1.0 + 2.0 * i))
        for i, s in enumerate(ruleset.signals)
    }


def test_residuals_at_the_reference_point(ruleset: Ruleset) -> None:
    """A fault-free plant has no residual: |R| < 1e-9 of the flow; all flows are positive there.
    Of every cell dR/dx is minus the derivative of the undone residual."""
    assert all(o.reference > 0 for o in ruleset.observers)
    names = [f"R:{r.id}" for r in ruleset.residuals]
    results = ruleset.plan.select(names).run(_reference(ruleset))
    largest = max(abs(o.reference) for o in ruleset.observers)
    assert max(float(abs(v[0])) for v in results.values()) < 1e-9 * largest
    reference = _reference(ruleset)
    zero = {f"x:{name}": 0.0 for name in ruleset.fault_by_id}
    slopes = ruleset.undo.run({**reference, **zero})
    terms = {r.id: r.terms for r in ruleset.residuals}
    for cell in (*ruleset.cells, *ruleset.unlisted_cells):
        undone = sum(
            t.sign * slopes[f"dq:{t.observer}:{cell.fault}"][0]
            for t in terms[cell.residual]
            if f"dq:{t.observer}:{cell.fault}" in slopes
        )
        assert cell.sensitivity == pytest.approx(-undone, rel=1e-6)


def test_derivatives_by_degree_are_right(ruleset: Ruleset) -> None:
    """dq/dx of the undo plan equals a central difference, for every fault and observer; of what the
    liquid does dql/dx. With all degrees 0 the undone observers are the observers, anywhere."""
    readings = _scatter(ruleset, 0.02)
    zero = {f"x:{name}": 0.0 for name in ruleset.fault_by_id}
    names = [f"q:{o.id}" for o in ruleset.observers]
    plain = ruleset.plan.select(names).run(readings)
    undone = ruleset.undo.select(names).run({**readings, **zero})
    assert all(plain[name] == pytest.approx(undone[name], rel=1e-12) for name in names)
    step = 1e-6
    for fault in ruleset.fault_by_id.values():
        for observer in fault.affects:
            of_liquid = "" if fault.module else "l"
            name, flow_name = f"dq{of_liquid}:{observer}:{fault.id}", f"q{of_liquid}:{observer}"
            at = {
                d: ruleset.undo.select([flow_name]).run({**readings, **zero, f"x:{fault.id}": d})[
                    flow_name
                ][0]
                for d in (-step, step)
            }
            derivative = ruleset.undo.select([name]).run({**readings, **zero})[name][0]
            flow = ruleset.observer_by_id[observer].reference
            assert derivative == pytest.approx((at[step] - at[-step]) / (2 * step), abs=1e-4 * flow)
