"""A diagnosis as data: JSON, and one CSV row per sample."""

from __future__ import annotations

from typing import Any

from runtime.csv_cell import row_of
from runtime.diagnose import Diagnosis
from runtime.findings import Finding, Period
from runtime.ruleset import Ruleset
from runtime.trace import Trace


def diagnosis_form(diagnosis: Diagnosis) -> dict[str, Any]:
    """The diagnosis as JSON data; flows in m3/s, times in s."""
    return {
        "plant": diagnosis.ruleset.plant,
        "ruleset": diagnosis.ruleset.sources,
        "mode": diagnosis.mode,
        "samples": diagnosis.samples,
        "judged": diagnosis.judged,
        "status": diagnosis.status,
        "findings": [_finding(f) for f in diagnosis.findings],
        "unknown": [_period(p, "text") for p in diagnosis.unknown],
        "not_judged": [_period(p, "because") for p in diagnosis.not_judged],
        "notes": list(diagnosis.notes),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "fault": finding.fault.id,
        "module": finding.fault.module,
        "degree": finding.degree,
        "lower": finding.lower,
        "upper": finding.upper,
        **({"unit": finding.fault.unit} if finding.fault.unit else {}),
        "probability": finding.probability,
        "since": finding.since,
        "until": finding.until,
        "alternatives": [{"fault": name, "probability": p} for name, p in finding.alternatives],
        "remote": [{"fault": name, "probability": p} for name, p in finding.remote],
        "together": list(finding.together),
        "evidence": [
            {
                "residual": e.residual,
                "value": e.value,
                "u": e.u,
                "u_systematic": e.u_systematic,
                "threshold": e.threshold,
                "verdict": e.verdict,
                "expected": e.expected,
            }
            for e in finding.evidence
        ],
        "text": finding.text,
        "action": finding.fault.action,
    }


def _period(period: Period, key: str) -> dict[str, Any]:
    return {"since": period.since, "until": period.until, key: period.text}


def trace_csv(trace: Trace, ruleset: Ruleset) -> str:
    """One row per sample: time, verdict, and per fault degree, lower and upper bound."""
    header = ["time [s]", "verdict"]
    for fault in ruleset.faults:
        header += [fault.id, f"{fault.id} lower", f"{fault.id} upper"]
    lines = [row_of(header)]
    for i, (time, verdict) in enumerate(zip(trace.time, trace.verdict, strict=True)):
        row = [f"{time:.10g}", verdict]
        for j in range(len(ruleset.faults)):
            row += [f"{v[j, i]:.5g}" for v in (trace.degree, trace.lower, trace.upper)]
        lines.append(",".join(row))
    return "\n".join(lines) + "\n"
