"""Residuals beside their thresholds, at one point of a recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.contract.threshold import sign_of, threshold_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.recordings.stationary import Timeline


@dataclass(frozen=True)
class Evidence:
    """A residual at one point, the strongest of a finding; flows in m3/s.

    `u_systematic` is the part of `u` that longer averaging does not lower. `verdict` is ``+``,
    ``-``, ``0`` or ``invalid``; `expected` what the fault predicts.
    """

    residual: str
    value: float
    u: float
    u_systematic: float
    threshold: float
    verdict: str
    expected: str


@dataclass(frozen=True)
class Latest:
    """All residuals of the last settled stretch or window, with or without a fault; times in s."""

    since: float
    until: float
    residuals: tuple[Evidence, ...]


def latest_of(ruleset: Ruleset, timeline: Timeline, evaluated: Sequence[EvaluatedPoints]) -> Latest:
    """Residuals of the last settled stretch, in the ruleset's order."""
    last = len(timeline) - 1
    found = {e.residual: e for part in evaluated for e in evidence_at(part, last)}
    ordered = tuple(found[r.id] for r in ruleset.residuals if r.id in found)
    return Latest(float(timeline.since[last]), float(timeline.until[last]), ordered)


def evidence_at(
    evaluated: EvaluatedPoints, point: int, fault: FaultSpec | None = None, *, ended: bool = False
) -> tuple[Evidence, ...]:
    """All residuals of a part at a point, beside those that a fault predicts: 0 without one. The
    baseline holds a fault that has `ended`: what is left without it has the opposite sign."""
    ruleset, observed = evaluated.part.ruleset, evaluated.observed
    cells = () if fault is None else ruleset.cells_of_fault[fault.id]
    of_sign = {1: "-", -1: "+"} if ended else {1: "+", -1: "-"}
    signs = {c.residual: of_sign.get(c.sign, "0") for c in cells}
    tables = observed.residuals, observed.residual_u, observed.residual_systematic
    rows = []
    for i, residual in enumerate(ruleset.residuals):
        value, u, shared = (float(table[i, point]) for table in tables)
        terms = [ruleset.observer_index[t.observer] for t in residual.terms]
        verdict = sign_of(value, u)
        if not (observed.valid[terms, point].all() and np.isfinite(value) and np.isfinite(u)):
            value, u, shared, verdict = 0.0, 0.0, 0.0, "invalid"
        expected = signs.get(residual.id, "0")
        rows.append(Evidence(residual.id, value, u, shared, threshold_of(u), verdict, expected))
    return tuple(rows)
