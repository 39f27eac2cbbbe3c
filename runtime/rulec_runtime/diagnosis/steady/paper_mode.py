"""Isolation as in the seed paper: Eqs. 17 to 19, with nothing added.

The degree of a fault is the smallest one that any of its non-zero residuals gives, the fault is the
one whose smallest degree is largest, and the bounds are minima too. docs/method.md shows where this
mislabels and why its degrees are biased low.
"""

from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Cell, Ruleset
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
    n = len(observed)
    names = [
        f"{kind}:{_form(cell)}:{cell.fault}:{cell.residual}"
        for cell in _ruled(ruleset)
        for kind in ("x", "ux")
    ]
    results = ruleset.plan.select(names).run(plan_inputs(observed.points))
    count = len(ruleset.faults)
    degree, lower, upper = (np.full((count, n), np.inf) for _ in range(3))
    triggered = np.ones((count, n), dtype=bool)
    rows = {f.id: i for i, f in enumerate(ruleset.faults)}
    columns = {r.id: i for i, r in enumerate(ruleset.residuals)}
    sound = _sound(ruleset, observed)
    with np.errstate(invalid="ignore"):
        fires = sound & (np.abs(observed.residuals) > limits.COVERAGE * observed.residual_u)
    for cell in _ruled(ruleset):
        key = f"{_form(cell)}:{cell.fault}:{cell.residual}"
        i, j = rows[cell.fault], columns[cell.residual]
        x = np.broadcast_to(results[f"x:{key}"], (n,))
        half = limits.COVERAGE * np.broadcast_to(results[f"ux:{key}"], (n,))
        # Beyond the pole of a rule the degree jumps out of its range: no fault of this kind.
        usable = sound[j] & np.isfinite(x) & np.isfinite(half)
        usable &= (x > 0) & (x <= ruleset.faults[i].highest)
        x, half = np.where(usable, x, 0.0), np.where(usable, half, 0.0)
        degree[i] = np.minimum(degree[i], x)
        lower[i] = np.minimum(lower[i], x - half)
        upper[i] = np.minimum(upper[i], x + half)
        triggered[i] &= fires[j]
    for table in (degree, lower, upper):
        table[~np.isfinite(table)] = 0.0
    result = PaperResult(np.zeros(n, dtype=bool), degree, np.maximum(lower, 0.0), upper)
    points = np.arange(n)
    winner = result.winner()
    deviating = triggered[winner, points] & (degree[winner, points] > 0)
    return replace(result, deviating=deviating)


def _ruled(ruleset: Ruleset) -> list[Cell]:
    """Cells with a rule: the paper has only faults of modules."""
    return [cell for cell in ruleset.cells if cell.forms]


def _sound(ruleset: Ruleset, observed: Observed) -> np.ndarray:
    """Residuals whose observers are all usable, shape (residuals, n)."""
    row = ruleset.observer_index
    return np.array(
        [
            np.all([observed.valid[row[t.observer]] for t in residual.terms], axis=0)
            for residual in ruleset.residuals
        ]
    ).reshape(-1, len(observed))


def _form(cell: Cell) -> str:
    return "paper" if "paper" in cell.forms else "linear"
