"""Isolation as the seed paper prints it: Eqs. 17 to 19, with nothing added.

The degree of a fault is the smallest one that any of its non-zero residuals gives, the fault is
the one whose smallest degree is largest, and the bounds are minima too. docs/method.md shows
where this mislabels and why its degrees are biased low.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.observe import Observed, plan_inputs
from runtime.plan import Array
from runtime.ruleset import Cell, Ruleset

COVERAGE = 2.0
"""Factor between standard uncertainty and the bounds; the paper does not give one."""


@dataclass(frozen=True)
class PaperResult:
    """Per fault and point: degree and bounds (faults, n); `deviating` where a residual fires."""

    deviating: np.ndarray
    degree: Array
    lower: Array
    upper: Array

    def winner(self) -> np.ndarray:
        """Index of the fault with the largest degree per point."""
        winner: np.ndarray = np.argmax(self.degree, axis=0)
        return winner


def judge_by_paper(ruleset: Ruleset, observed: Observed) -> PaperResult:
    """Apply Eqs. 17-19 to every point."""
    n = len(observed)
    names = [
        f"{kind}:{_form(cell)}:{cell.fault}:{cell.residual}"
        for cell in ruleset.cells
        for kind in ("x", "ux")
    ]
    results = ruleset.plan.select(names).run(plan_inputs(observed.points))
    count = len(ruleset.faults)
    degree = np.full((count, n), np.inf)
    lower, upper = degree.copy(), degree.copy()
    row = {f.id: i for i, f in enumerate(ruleset.faults)}
    for cell in ruleset.cells:
        key = f"{_form(cell)}:{cell.fault}:{cell.residual}"
        x = np.broadcast_to(results[f"x:{key}"], (n,))
        half = COVERAGE * np.broadcast_to(results[f"ux:{key}"], (n,))
        usable = np.isfinite(x) & (x > 0)
        i = row[cell.fault]
        degree[i] = np.minimum(degree[i], np.where(usable, x, 0.0))
        lower[i] = np.minimum(lower[i], np.where(usable, x - half, 0.0))
        upper[i] = np.minimum(upper[i], np.where(usable, x + half, 0.0))
    for table in (degree, lower, upper):
        table[~np.isfinite(table)] = 0.0
    with np.errstate(invalid="ignore"):
        fires: np.ndarray = np.abs(observed.residuals) > COVERAGE * observed.residual_u
    return PaperResult(np.any(fires, axis=0), degree, np.maximum(lower, 0.0), upper)


def _form(cell: Cell) -> str:
    return "paper" if "paper" in cell.forms else "linear"
