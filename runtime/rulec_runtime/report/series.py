"""Evaluate the estimates and residuals per sample that the pictures show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ResidualSpec
from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.evaluated_points import (
    EvaluatedPoints,
    evaluate_samples,
    evaluate_stretches,
    judgeable,
    residuals_at,
    usable_at,
)
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.verdict_per_sample import Trace
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.chart import runs_of
from rulec_runtime.report.thin_curves import is_long
from rulec_runtime.report.wording import FlowUnit, flow_unit, worst_first

MOST = 12
"""Most residuals drawn."""

WINDOW = 600
"""Most samples of a long recording that are drawn individually."""

ASIDE = 150
"""Samples drawn before and after a finding."""

NOT_JUDGED = ("moving", "cannot judge")
"""Verdicts of a trace for samples that were not judged."""


@dataclass(frozen=True)
class Side:
    """An estimate of the flow through a module: an observer, or the sum of some."""

    module: str
    observers: tuple[str, ...]

    @property
    def short(self) -> str:
        """Name on a curve; the common name of several observers follows a sum sign."""
        if len(self.observers) == 1:
            return self.observers[0].removeprefix(f"{self.module}.")
        names = {o.partition(".")[2] or o for o in self.observers}
        return f"Σ {names.pop()}" if len(names) == 1 else " + ".join(self.observers)


@dataclass(frozen=True)
class Curves:
    """Estimates of one module and some residuals over all samples of a recording.

    Attributes
    ----------
    time : shape (n,), s.
    judged : shape (n,), samples of settled stretches that could be judged.
    flows, flows_u : shape (sides, n), in `unit`, not corrected; NaN where an estimate is unusable.
    values, thresholds : shape (residuals, n), in `unit`, relative to the baseline; a residual fires
        beyond its threshold.
    focus : period of the largest finding, else of the first unknown deviation, s.
    learned : whether there is a baseline.
    calendar : dates of the times, if the recording has them.
    """

    time: Array
    judged: np.ndarray
    unit: FlowUnit
    sides: tuple[Side, ...]
    flows: Array
    flows_u: Array
    residuals: tuple[ResidualSpec, ...]
    values: Array
    thresholds: Array
    focus: tuple[float, float] | None
    learned: bool
    calendar: Calendar | None = None

    def at(self, chosen: slice) -> Curves:
        """A run of the samples."""
        names = ("time", "judged", "flows", "flows_u", "values", "thresholds")
        return replace(self, **{name: getattr(self, name)[..., chosen] for name in names})

    def formed(self) -> np.ndarray:
        """Residuals that exist on some judged sample, shape (residuals,)."""
        return np.array([np.isfinite(row[self.judged]).any() for row in self.values], dtype=bool)

    def fired(self) -> np.ndarray:
        """Where each residual fires on a judged sample, shape (residuals, n)."""
        with np.errstate(invalid="ignore"):
            result: np.ndarray = self.judged & (np.abs(self.values) > self.thresholds)
        return result


def sides_of(residual: ResidualSpec) -> tuple[Side, ...]:
    """The sides that a residual compares: the sums of its positive and of its negative terms."""
    parts = (tuple(t.observer for t in residual.terms if t.sign == sign) for sign in (1, -1))
    return tuple(Side(residual.module, part) for part in parts if part)


def curves_of(recording: Recording, diagnosis: Diagnosis, trace: Trace) -> Curves:
    """Evaluate the estimates and residuals to draw, block by block."""
    ruleset, unit = diagnosis.ruleset, flow_unit(diagnosis.ruleset)
    judged = np.array([word not in NOT_JUDGED for word in trace.verdict], dtype=bool)
    residuals = _shown(diagnosis)
    module = _module(diagnosis)
    sides = tuple(
        dict.fromkeys(s for r in ruleset.residuals if r.module == module for s in sides_of(r))
    )
    n = len(recording)
    flows, flows_u = np.full((2, len(sides), n), np.nan)
    values, thresholds = np.full((2, len(residuals), n), np.nan)
    index = ruleset.observer_index
    rows = [ruleset.residuals.index(r) for r in residuals]
    learned = False
    for here, points in _batches(recording, diagnosis):
        learned |= any(len(part.baselines.learned) for part in points)
        observed, valid = observe(ruleset, points[0].points), usable_at(ruleset, points)
        for i, side in enumerate(sides):
            members = [index[o] for o in side.observers]
            sound = valid[members].all(axis=0)
            variance = observed.covariance[:, members][:, :, members].sum(axis=(1, 2))
            flows[i, here] = np.where(sound, observed.flows[members].sum(axis=0), np.nan)
            flows_u[i, here] = np.where(sound, np.sqrt(np.maximum(variance, 0.0)), np.nan)
        found, u = residuals_at(ruleset, points)
        for i, residual in enumerate(residuals):
            sound = valid[[index[t.observer] for t in residual.terms]].all(axis=0)
            values[i, here] = np.where(sound, found[rows[i]], np.nan)
            thresholds[i, here] = np.where(sound, threshold_of(u[rows[i]]), np.nan)
    spans = [(f.since, f.until) for f in worst_first(diagnosis.findings)]
    spans += [(p.since, p.until) for p in diagnosis.unknown]
    return Curves(
        time=recording.time,
        judged=judged,
        unit=unit,
        sides=sides,
        flows=unit.factor * flows,
        flows_u=unit.factor * flows_u,
        residuals=residuals,
        values=unit.factor * values,
        thresholds=unit.factor * thresholds,
        focus=spans[0] if spans else None,
        learned=learned,
        calendar=diagnosis.calendar,
    )


def _batches(
    recording: Recording, diagnosis: Diagnosis
) -> Iterator[tuple[np.ndarray, list[EvaluatedPoints]]]:
    """All samples, evaluated as the diagnosis evaluated their stretches."""
    ruleset = diagnosis.ruleset
    stretches, noise = judgeable(recording, ruleset, diagnosis.mode)
    if len(stretches):
        every = evaluate_stretches(recording, ruleset, stretches, noise, diagnosis.mode, keep=True)
        samples = np.arange(len(recording))
        yield from evaluate_samples(recording, ruleset, noise, stretches, every, samples)


def _shown(diagnosis: Diagnosis) -> tuple[ResidualSpec, ...]:
    """Residuals to draw: all of a small plant, else first those behind the findings."""
    every = diagnosis.ruleset.residuals
    if len(every) <= MOST:
        return every
    rank: dict[str, float] = {}
    for finding in worst_first(diagnosis.findings):
        for e in finding.evidence:
            size = abs(e.value) / e.threshold if e.threshold else 0.0
            rank[e.residual] = max(rank.get(e.residual, 0.0), size + 1e3 * (e.expected != "0"))
    module = _module(diagnosis)
    best = sorted(every, key=lambda r: (-rank.get(r.id, 0.0), r.module != module))[:MOST]
    return tuple(r for r in every if r in best)


def _module(diagnosis: Diagnosis) -> str:
    """The module whose estimates are drawn: that of the largest finding, else the first."""
    residuals = diagnosis.ruleset.residuals
    compared = list(dict.fromkeys(r.module for r in residuals))
    for finding in worst_first(diagnosis.findings):
        fired = [e.residual for e in finding.evidence if e.verdict in ("+", "-")]
        named = [r.module for r in residuals if r.id in fired]
        for name in (finding.fault.module, *named):
            if name in compared:
                return name
    return compared[0] if compared else ""


def detail(curves: Curves) -> Curves:
    """The part of a long recording around its focus, else its beginning; a short one whole."""
    if not is_long(curves.time):
        return curves
    since, until = np.searchsorted(curves.time, curves.focus or curves.time[:2])
    first = max(int(since) - ASIDE, 0)
    return curves.at(slice(first, min(int(until) + ASIDE, first + WINDOW)))


def excess(curves: Curves) -> dict[int, float]:
    """Ratio of a residual to its threshold, averaged over each run of at least three judged samples
    that fire: the largest, by index of the residual. A sample that was not judged ends a run."""
    found = {}
    for i, row in enumerate(curves.fired()):
        ratio = np.abs(curves.values[i]) / curves.thresholds[i]
        runs = [run for run in runs_of(row) if run.stop - run.start >= limits.SHORTEST_STRETCH]
        if runs:
            found[i] = max(float(np.mean(ratio[run])) for run in runs)
    return found
