"""Findings: a fault over a period, with its evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from runtime.isolate import Isolation
from runtime.observe import Observed
from runtime.plan import Array
from runtime.ruleset import THRESHOLD, FaultSpec, Ruleset
from runtime.runs import COVERAGE, runs_of
from runtime.stationary import LONGEST, Stretches
from runtime.verdict import Verdict, partly_blind

MENTION = 0.02
"""Alternatives less probable than this are not mentioned."""


@dataclass(frozen=True)
class Evidence:
    """A residual at the strongest point of a finding; flows in m3/s.

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
class Finding:
    """A fault that fits, over a period; times in s."""

    fault: FaultSpec
    degree: float
    lower: float
    upper: float
    probability: float
    since: float
    until: float
    alternatives: tuple[tuple[str, float], ...]
    evidence: tuple[Evidence, ...]
    readings: tuple[tuple[str, float], ...]
    flows: tuple[tuple[str, float, float], ...]
    text: str


@dataclass(frozen=True)
class Period:
    """A period with a remark: why nothing was judged, or what does not fit."""

    since: float
    until: float
    text: str


def findings_of(
    time: Array,
    ruleset: Ruleset,
    stretches: Stretches,
    observed: Observed,
    isolation: Isolation,
    verdicts: list[Verdict],
) -> tuple[list[Finding], list[Period], list[Period]]:
    """Join neighbouring stretches that say the same; blind ones do not interrupt a finding."""
    findings: list[Finding] = []
    periods: dict[str, list[Period]] = {"unknown": [], "outside": [], "blind": []}
    for kind, members in runs_of(verdicts, isolation, _pauses(time, stretches)):
        since = float(time[stretches.first[members[0]]])
        until = float(time[stretches.last[members[-1]] - 1])
        if kind == "fault":
            findings.append(_finding(ruleset, observed, isolation, members, since, until))
        elif kind in periods:
            periods[kind].append(Period(since, until, verdicts[members[0]].text))
    blind = periods["blind"] + _in_part(time, ruleset, stretches, observed, isolation)
    unknown = sorted([*periods["unknown"], *periods["outside"]], key=lambda p: p.since)
    return sorted(findings, key=lambda f: f.since), unknown, sorted(blind, key=lambda p: p.since)


def _in_part(
    time: Array,
    ruleset: Ruleset,
    stretches: Stretches,
    observed: Observed,
    isolation: Isolation,
) -> list[Period]:
    """Periods in which some estimates were missing, neighbouring ones joined."""
    found: list[Period] = []
    last = ""
    for i in range(len(stretches)):
        text = partly_blind(ruleset, observed, isolation, i)
        since, until = float(time[stretches.first[i]]), float(time[stretches.last[i] - 1])
        if text and text == last:
            found[-1] = replace(found[-1], until=until)
        elif text:
            found.append(Period(since, until, text))
        last = text
    return found


def _pauses(time: Array, stretches: Stretches) -> set[int]:
    """Stretches before which nothing was recorded for long."""
    if len(time) < 2:
        return set()
    limit = LONGEST * float(np.median(np.diff(time)))
    between = time[stretches.first[1:]] - time[stretches.last[:-1] - 1]
    return {int(i) + 1 for i in np.flatnonzero(between > limit)}


def _finding(
    ruleset: Ruleset,
    observed: Observed,
    isolation: Isolation,
    members: list[int],
    since: float,
    until: float,
) -> Finding:
    """Sum a run up: degree weighted by precision, evidence at the strongest point."""
    best = int(np.argmax(isolation.probability[:, members].mean(axis=1)))
    fault = ruleset.faults[best]
    degrees, u = isolation.degree[best, members], isolation.u[best, members]
    weights = 1.0 / np.maximum(u, 1e-12) ** 2
    degree = float(np.sum(weights * degrees) / np.sum(weights))
    # Systematic errors do not average out over a run, so the uncertainty is that of one stretch;
    # the scatter of the stretches is added.
    half = COVERAGE * float(np.hypot(np.min(u), np.sqrt(np.average((degrees - degree) ** 2))))
    strongest = members[int(np.argmax(isolation.misfit[members]))]
    mean = isolation.probability[:, members].mean(axis=1)
    others = tuple(
        (ruleset.faults[i].id, float(mean[i]))
        for i in np.argsort(-mean, kind="stable")
        if i != best and mean[i] > MENTION
    )
    return Finding(
        fault,
        degree,
        max(degree - half, fault.lowest),
        min(degree + half, fault.highest),
        float(mean[best]),
        since,
        until,
        others,
        _evidence(ruleset, observed, fault, strongest),
        _readings(ruleset, observed, strongest),
        _flows(ruleset, observed, strongest),
        fault.text.replace("{degree}", _percent(degree)),
    )


def _percent(degree: float) -> str:
    return f"{100 * degree:.3g} %"


def _evidence(
    ruleset: Ruleset, observed: Observed, fault: FaultSpec, point: int
) -> tuple[Evidence, ...]:
    signs = {c.residual: c.sign for c in ruleset.cells_of_fault[fault.id]}
    index = {o.id: i for i, o in enumerate(ruleset.observers)}
    rows = []
    for i, residual in enumerate(ruleset.residuals):
        expected = {1: "+", -1: "-", 0: "0"}[signs.get(residual.id, 0)]
        value, u = float(observed.residuals[i, point]), float(observed.residual_u[i, point])
        shared = float(observed.residual_systematic[i, point])
        usable = all(observed.valid[index[t.observer], point] for t in residual.terms)
        verdict = "invalid"
        if usable and np.isfinite(value) and np.isfinite(u):
            verdict = "0" if abs(value) <= THRESHOLD * u else ("+" if value > 0 else "-")
        else:
            value, u, shared = 0.0, 0.0, 0.0
        rows.append(Evidence(residual.id, value, u, shared, THRESHOLD * u, verdict, expected))
    return tuple(rows)


def _readings(ruleset: Ruleset, observed: Observed, point: int) -> tuple[tuple[str, float], ...]:
    used = {s for o in ruleset.observers for s in o.signals}
    return tuple(
        (s.id, float(observed.points.values[s.id][point]))
        for s in ruleset.signals
        if s.id in used and s.id in observed.points.values
    )


def _flows(
    ruleset: Ruleset, observed: Observed, point: int
) -> tuple[tuple[str, float, float], ...]:
    spread = np.sqrt(np.sum(observed.gradients[:, :, point] ** 2, axis=1))
    return tuple(
        (o.id, float(observed.flows[i, point]), float(spread[i]))
        for i, o in enumerate(ruleset.observers)
        if observed.valid[i, point]
    )
