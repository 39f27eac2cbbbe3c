"""Words that the terminal and the report share, so that both describe a diagnosis alike."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rulec_runtime import limits
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.recordings.plant_calendar import span
from rulec_runtime.report.text import percent

if TYPE_CHECKING:  # words alone need nothing that judges recordings
    from rulec_runtime.diagnosis.sensors.conditions import SensorFinding
    from rulec_runtime.diagnosis.steady.evidence import Evidence
    from rulec_runtime.diagnosis.steady.findings import Finding, Period
    from rulec_runtime.diagnosis.steady.regimes import RegimeFinding
    from rulec_runtime.recordings.plant_calendar import Calendar

STATUS = {
    "F": ("✖", "failure"),
    "C": ("▼", "check function: check what was recorded first"),
    "S": ("▲", "out of specification"),
    "M": ("◆", "maintenance required"),
    "ok": ("✓", "no fault found"),
}
"""Letter of NE 107 to symbol and meaning; each symbol has its own shape."""

COLOURS = {"F": "red", "C": "dark_orange", "S": "yellow", "M": "blue", "ok": "green"}
"""Colour of each letter of NE 107; symbol and letter carry the same meaning."""


def status_in_words(symbol: str, letter: str, meaning: str) -> str:
    """An overall status, as ``◆ M maintenance required`` or ``✓ OK, no fault found``."""
    return " ".join(filter(None, (symbol, "OK," if letter == "ok" else letter, meaning)))


LARGE = 5e-3
"""Typical flow, m3/s, above which l/h would have too many digits."""

NOT_ALL = "no known fault fits all of this time"
"""Of a finding that is improbable although nothing fits better."""

SHOWN = 5
"""Most faults described in full."""

LISTED = 12
"""Most findings listed individually (else one row per fault), and residuals per finding."""

SPANS = 4
"""Most periods named for one remark."""


def treatment_of(found: SensorFinding) -> str:
    """How an invalid reading or clock is treated."""
    if found.mended:
        return f"judged with this corrected: {found.mended}"
    if found.signal:
        return "its readings there are left out; the rest is judged without them"
    if found.condition.name == "repeated":
        return "of rows with the same time the first counts"
    return "rows keep their order; later times are shifted"


@dataclass(frozen=True)
class FlowUnit:
    """Unit in which a plant's flows are shown; shown = SI * factor."""

    name: str
    factor: float


L_PER_H, M3_PER_H = FlowUnit("l/h", 3.6e6), FlowUnit("m3/h", 3600.0)


def flow_unit(ruleset: Ruleset) -> FlowUnit:
    """l/h for a rig, m3/h for a station."""
    flows = sorted(abs(o.reference) for o in ruleset.observers)
    large = bool(flows) and flows[len(flows) // 2] > LARGE
    return M3_PER_H if large else L_PER_H


def residual_texts(ruleset: Ruleset, evidence: Evidence, flow: FlowUnit) -> tuple[str, str]:
    """Value and threshold of a residual, a dash if it is not available: in `flow` for a residual of
    flows, in the reading's unit for that of a reading."""
    if evidence.verdict == "invalid":
        return "-", "-"
    signal = ruleset.signal_by_id.get(evidence.residual)
    if signal is None:
        value, threshold = flow.factor * evidence.value, flow.factor * evidence.threshold
        value_text, threshold_text = rounded(value, threshold, digits=3)
        return value_text, f"±{threshold_text}"
    value, threshold = evidence.value / signal.factor, evidence.threshold / signal.factor
    return f"{value:.3g} {signal.unit}", f"±{threshold:.2g} {signal.unit}"


def rounded(value: float, half: float, digits: int = 2) -> tuple[str, str]:
    """A value and its half width, to `digits` of the latter, but at most one decimal.

    >>> rounded(16297.4, 1021.2), rounded(110.94, 10.41), rounded(520.3, 6.8)
    (('16300', '1000'), ('111', '10'), ('520.3', '6.8'))
    """
    decimal = digits - 1 - math.floor(math.log10(half)) if 0.0 < half < math.inf else 1
    decimals = min(decimal, 1)
    shown = (f"{round(v, decimals):z.{max(decimals, 0)}f}" for v in (value, half))
    return next(shown), next(shown)


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """The largest finding of each fault, at most five."""
    largest: dict[str, Finding] = {}
    for finding in findings:
        before = largest.get(finding.fault.id)
        if before is None or finding.degree > before.degree:
            largest[finding.fault.id] = finding
    return sorted(largest.values(), key=lambda f: -f.degree)[:SHOWN]


def remarks_of(periods: Iterable[Period], calendar: Calendar | None) -> list[tuple[str, str]]:
    """Distinct remarks, each with its periods."""
    kinds: dict[str, list[Period]] = {}
    for period in periods:
        kinds.setdefault(period.text, []).append(period)
    found = []
    for text, members in kinds.items():
        spans = ", ".join(span(calendar, p.since, p.until) for p in members[:SPANS])
        more = f" and {len(members) - SPANS} more" if len(members) > SPANS else ""
        sizes = ", ".join(
            f"{name} {100 * size:+.2g} % of the flow, threshold {100 * threshold:.2g} %"
            for name, size, threshold in members[0].off
        )
        found.append((f"{text} ({sizes})" if sizes else text, spans + more))
    return found


def evidence_first(finding: Finding) -> list[Evidence]:
    """Residuals of a finding; those that it should move, and that moved, come first."""
    return sorted(finding.evidence, key=lambda e: (e.expected == "0", e.verdict == "0"))


def conditions(found: RegimeFinding) -> str:
    """The conditions of a regime with their margins in standard uncertainties."""
    margins = dict(found.margins)
    return ", ".join(
        f"{c.text} (by {margins[c.text]:.3g} u)" if c.text in margins else c.text
        for c in found.regime.when
    )


def headline(ruleset: Ruleset, finding: Finding) -> str:
    """The finding, and alternatives that are nearly as probable."""
    text = finding.text
    for name, probability in finding.alternatives:
        if probability > limits.HEADLINE_RIVAL or probability >= finding.probability:
            text += f"; or {titled(ruleset.fault_by_id[name])} ({100 * probability:.0f} %)"
    return text


def actions(ruleset: Ruleset, finding: Finding) -> str:
    """Actions for the fault and its alternatives, the most probable first."""
    if finding.from_sheet:
        first = (
            "calibrate, or run `rulec mismatch`, as the deviation is there from the first sample"
        )
        return f"{first}; or {actions(ruleset, replace(finding, from_sheet=False))}"
    if not finding.alternatives:
        return finding.fault.action
    found = [(finding.fault.id, finding.probability), *finding.alternatives[:SHOWN]]
    causes_of: dict[str, dict[str, None]] = {}
    for name, _ in sorted(found, key=lambda one: -one[1]):
        fault = ruleset.fault_by_id[name]
        where = fault.scales[0] if fault.in_sensor and fault.scales else titled(fault)
        causes_of.setdefault(fault.action, {})[where] = None
    return "; or ".join(f"{action} ({', '.join(c)})" for action, c in causes_of.items())


def why_first(ruleset: Ruleset, finding: Finding) -> Iterator[str]:
    """Why this fault is named first, compared with rarer and more frequent alternatives."""
    fault = finding.fault
    others = [ruleset.fault_by_id[name] for name, _ in finding.alternatives]
    rarer = [f for f in others if f.odds < fault.odds]
    if rarer:
        both = "both fit" if len(others) == 1 else "all of them fit"
        words = "; ".join(map(_how_often, (fault, *rarer)))
        yield f"{both} the readings; {fault.id} comes first because it occurs more often ({words})"
    for other in others:
        if other.odds > fault.odds:
            words = f"{_how_often(other)}; {_how_often(fault)}"
            yield f"{other.id} occurs more often, but the readings favour {fault.id} ({words})"


def _how_often(fault: FaultSpec) -> str:
    return f"{fault.id}: {fault.frequency}{', not listed by its module' * fault.unlisted}"


def titled(fault: FaultSpec) -> str:
    """A fault with its module, as a phrase."""
    if not fault.module:
        return fault.title[:1].lower() + fault.title[1:]
    if fault.title.startswith(f"{fault.module}."):
        return fault.title
    return f"{fault.title.lower()} in {fault.module}"


def residual_rows(ruleset: Ruleset, finding: Finding) -> list[tuple[str, ...]]:
    """Of the first residuals of a finding: name, value, threshold, what fired, what was expected,
    and how far that supports the finding."""
    unit = flow_unit(ruleset)
    return [
        (
            e.residual,
            *residual_texts(ruleset, e, unit),
            e.verdict,
            e.expected,
            agreement(ruleset, finding, e),
        )
        for e in evidence_first(finding)[:LISTED]
    ]


def agreement(ruleset: Ruleset, finding: Finding, evidence: Evidence) -> str:
    """Whether a residual supports a finding, in words."""
    if evidence.verdict == "invalid":
        return "not available"
    if evidence.verdict == evidence.expected:
        return "✓ as predicted"
    for other in finding.together:
        if any(c.residual == evidence.residual for c in ruleset.cells_of_fault[other]):
            return f"moved by {other} too"
    cells = {c.residual: c for c in ruleset.cells_of_fault[finding.fault.id]}
    cell = cells.get(evidence.residual)
    if evidence.verdict == "0" and cell is not None and cell.detectable > finding.degree:
        return f"visible above {cell.detectable:.2g}"
    if evidence.verdict == "0":
        return "~ weaker than expected"
    # What a fault does to two estimates need not be quite the same.
    touched, fault = {*finding.fault.affects}, finding.fault
    terms = [t.observer for r in ruleset.residuals if r.id == evidence.residual for t in r.terms]
    if cell is None and fault.tolerance and terms and touched.issuperset(terms):
        return "~ within tolerance"
    return "✗ not as predicted"


@dataclass(frozen=True)
class Estimate:
    """An observer at the strongest point: equation, flow and 95 % half width in m3/s, readings."""

    equation: str
    flow: float
    half: float
    readings: tuple[str, ...]


def estimates(ruleset: Ruleset, finding: Finding) -> Iterator[Estimate]:
    """The observers behind a finding, with their readings."""
    readings = dict(finding.readings)
    terms = {r.id: r.terms for r in ruleset.residuals}
    cells = ruleset.cells_of_fault[finding.fault.id]
    near = {t.observer for c in cells for t in terms.get(c.residual, ())}
    for name, flow, u in finding.flows:
        if name not in near:
            continue
        spec = ruleset.observer_by_id[name]
        parts = tuple(_in_unit(ruleset, s, readings[s]) for s in spec.signals if s in readings)
        yield Estimate(spec.equation, flow, limits.COVERAGE * u, parts)


def readings_of(ruleset: Ruleset, finding: Finding) -> str:
    """Readings that a finding rests on, each in its unit."""
    return ", ".join(_in_unit(ruleset, name, value) for name, value in finding.readings)


def _in_unit(ruleset: Ruleset, name: str, value: float) -> str:
    signal = ruleset.signal_by_id[name]
    return f"{name} {signal.shown(value):.4g} {signal.unit}"


def context(ruleset: Ruleset, finding: Finding) -> Iterator[str]:
    """What the residuals are compared with, and what else was found with the finding."""
    if finding.baseline:
        stored = ruleset.dynamics is not None
        plural = ("s" if stored else "es") * (finding.baseline > 1)
        part = "window" if stored else "stretch"
        yield (
            f"reference: {finding.baseline} fault-free {part}{plural} of this recording; what "
            "already deviated there counts as an error of sensors or calibration"
        )
    elif finding.evidence and all(e.verdict == "0" for e in finding.evidence if e.expected != "0"):
        yield (
            "no operating point shows it alone; all of them together do: an error within the "
            "sensors' bounds would be the same at each"
        )
    for name in finding.together:
        yield f"explains the readings only together with {name}"


def causes(found: Iterable[tuple[str, float]]) -> str:
    """Some causes with their probabilities."""
    return ", ".join(f"{name} ({percent(p)})" for name, p in list(found)[:SHOWN])


def advice(ruleset: Ruleset, finding: Finding) -> Iterator[str]:
    """How to distinguish a finding from its alternatives."""
    others = {name for name, _ in finding.alternatives}
    for group in ruleset.ambiguous:
        if finding.fault.id in group.faults and others & set(group.faults):
            yield f"{' / '.join(group.faults)}: {group.advice}"
