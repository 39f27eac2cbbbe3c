"""Beside a rule engine that takes sample by sample: `rule-engine`, whose rules are text."""

from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.stationary import systematic_u

from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.bench.row import Row, median
from tests.conftest import compiled

SAMPLES, FEW = 100_000, 1000
COVERAGE, DEGREE = 2.0, 0.5


def rows() -> list[Row]:
    """Which faults have all their signs, in every sample."""
    from rule_engine import Rule

    rules = compiled("abc")
    plan = rules.plan.select([n for n in rules.plan.outputs if n.startswith(("R:", "u:"))])
    inputs: dict[str, Any] = {"u:parameters": 1.0, "u:model": 1.0, **_with_faults(rules)}
    for signal in rules.signals:
        if signal.id in plan.inputs:
            inputs[f"u:{signal.id}"] = systematic_u(signal, inputs[signal.id])
    expected = signs_match(rules, plan.run(inputs))
    written = {fault: Rule(text) for fault, text in texts(rules).items()}
    facts = _facts(rules, plan.run(inputs), FEW)

    def one_by_one() -> list[list[bool]]:
        return [[rule.matches(fact) for rule in written.values()] for fact in facts]

    assert np.array(one_by_one()).tolist() == expected[:FEW].tolist()
    assert expected.any()
    whole = median(lambda: signs_match(rules, plan.run(inputs)), 3) / SAMPLES
    return [
        Row(
            key="rule-engine",
            what=f"{len(written)} rules on a sample of {SAMPLES:,}",
            peer="rule-engine",
            ours=whole,
            theirs=median(one_by_one, 3) / FEW,
            same="the same rules with the same answers in every sample",
            differs="residuals and thresholds are handed to it; ours works them out of readings",
        )
    ]


def _with_faults(rules: Ruleset) -> dict[str, Array]:
    """Readings by signal, shape (SAMPLES,), SI: each fault for some samples, then none."""
    faults = [f.id for f in rules.faults]
    degrees = {f: np.where(np.arange(FEW) % (2 * len(faults)) == 2 * i, DEGREE, 0.0)
               for i, f in enumerate(faults)}  # fmt: skip
    simulated = simulate_with(equations_of(rules), {}, degrees)
    assert simulated.solved.all()
    values = sense(rules, simulated.values, SensorErrors(bounded=True), np.random.default_rng(3))
    return {name: np.tile(v, SAMPLES // FEW) for name, v in values.items()}


def signs_match(rules: Ruleset, values: dict[str, Array]) -> Any:
    """Whether a fault's signs are those of the residuals, shape (n, faults)."""
    signs = {
        r.id: (values[f"R:{r.id}"] > COVERAGE * values[f"u:{r.id}"]).astype(int)
        - (values[f"R:{r.id}"] < -COVERAGE * values[f"u:{r.id}"])
        for r in rules.residuals
    }
    columns = []
    for fault in rules.faults:
        own = [signs[c.residual] == c.sign for c in rules.cells if c.fault == fault.id]
        columns.append(np.logical_and.reduce(own))
    return np.column_stack(columns)


def texts(rules: Ruleset) -> dict[str, str]:
    """A rule per fault, in the language of the peer."""
    number = {r.id: i for i, r in enumerate(rules.residuals)}
    found = {}
    for fault in rules.faults:
        own = [(number[c.residual], c.sign) for c in rules.cells if c.fault == fault.id]
        parts = [f"r{i} > t{i}" if sign > 0 else f"r{i} < 0 - t{i}" for i, sign in own]
        found[fault.id] = " and ".join(parts)
    return found


def _facts(rules: Ruleset, values: dict[str, Array], count: int) -> list[dict[str, float]]:
    found: list[dict[str, float]] = [{} for _ in range(count)]
    for i, residual in enumerate(rules.residuals):
        for k in range(count):
            found[k][f"r{i}"] = float(values[f"R:{residual.id}"][k])
            found[k][f"t{i}"] = float(COVERAGE * values[f"u:{residual.id}"][k])
    return found
