"""Isolation as in the seed paper: Eqs. 17 to 19, with nothing added.

The degree of a fault is the smallest one that any of its non-zero residuals gives, the fault is the
one whose smallest degree is largest, and the bounds are minima too. docs/method.md shows where this
mislabels and why its degrees are biased low.
"""

from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.observe import Observed, plan_inputs


@dataclass(frozen=True)
class PaperResult:
    """Per fault and point: degree and bounds (faults, n).

    `deviating` where all residuals of the winner fire: "for a fault to be diagnosed, all its
    associated diagnosis rules have to be triggered" (section 3.6.4).
    """

    deviating: np.ndarray
    degree: Array
    lower: Array
    upper: Array

    def winner(self) -> np.ndarray:
        """Index of the fault with the largest degree per point."""
        return np.asarray(np.argmax(self.degree, axis=0))


def judge_by_paper(ruleset: Ruleset, observed: Observed) -> PaperResult:
    """Apply Eqs. 17-19 to every point."""
    # Cells with a rule: the paper has only faults of modules.
    cells = [cell for cell in ruleset.cells if cell.forms]
    forms = ["paper" if "paper" in cell.forms else "linear" for cell in cells]
    keys = [f"{f}:{c.fault}:{c.residual}" for f, c in zip(forms, cells, strict=True)]
    plan = ruleset.plan.select(f"{kind}:{key}" for key in keys for kind in ("x", "ux"))
    results, count, n = plan.run(plan_inputs(observed.points)), len(ruleset.faults), len(observed)
    x, u = (
        np.array([np.broadcast_to(results[f"{kind}:{key}"], (n,)) for key in keys]).reshape(-1, n)
        for kind in ("x", "ux")
    )
    rows = {f.id: i for i, f in enumerate(ruleset.faults)}
    columns = {r.id: i for i, r in enumerate(ruleset.residuals)}
    own = np.array([rows[cell.fault] for cell in cells], dtype=int)
    shown = np.array([columns[cell.residual] for cell in cells], dtype=int)
    index = ruleset.observer_index
    terms = [[index[t.observer] for t in residual.terms] for residual in ruleset.residuals]
    sound = np.array([observed.valid[term].all(axis=0) for term in terms]).reshape(-1, n)
    with np.errstate(invalid="ignore"):
        fires = sound & (np.abs(observed.residuals) > limits.COVERAGE * observed.residual_u)
        # Beyond the pole of a rule the degree jumps out of its range: no fault of this kind.
        highest = np.array([fault.highest for fault in ruleset.faults])[own, None]
        usable = sound[shown] & np.isfinite(u) & (x > 0) & (x <= highest)
    x, half = np.where(usable, x, 0.0), np.where(usable, limits.COVERAGE * u, 0.0)
    tables = np.full((3, count, n), np.inf)
    for table, values in zip(tables, (x, x - half, x + half), strict=True):
        np.minimum.at(table, own, values)
    degree, lower, upper = np.where(np.isfinite(tables), tables, 0.0)
    triggered = np.ones((count, n), dtype=bool)
    np.logical_and.at(triggered, own, fires[shown])
    winner, points = np.argmax(degree, axis=0), np.arange(n)
    deviating = triggered[winner, points] & (degree[winner, points] > 0)
    return PaperResult(deviating, degree, np.maximum(lower, 0.0), upper)
