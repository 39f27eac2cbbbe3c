"""Write a diagnosis as data: JSON, and one CSV row per sample."""

from typing import Any

from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.hidden_faults import Blind
from rulec_runtime.diagnosis.sensors.conditions import SensorFinding
from rulec_runtime.diagnosis.steady.findings import Events, Finding, Period, Step
from rulec_runtime.diagnosis.steady.growth import Growth
from rulec_runtime.diagnosis.steady.regimes import RegimeFinding
from rulec_runtime.diagnosis.verdict_per_sample import Trace
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.report.wording import actions, why_first

Timed = Finding | SensorFinding | RegimeFinding

EVIDENCE = ("residual", "value", "u", "u_systematic", "threshold", "verdict", "expected")
"""Keys of each residual of a finding."""


def diagnosis_form(diagnosis: Diagnosis) -> dict[str, Any]:
    """The diagnosis as JSON data; flows in m3/s, times in s."""
    calendar = diagnosis.calendar
    return {
        "plant": diagnosis.ruleset.plant,
        "ruleset": diagnosis.ruleset.sources,
        **_taken(diagnosis, "mode", "samples", "judged", "status"),
        "findings": [
            *(_sensor(f, calendar) for f in diagnosis.sensors),
            *(_finding(diagnosis.ruleset, f, calendar) for f in diagnosis.findings),
        ],
        "regimes": [_regime(r, calendar) for r in diagnosis.regimes],
        "unknown": [_period(p, "text", calendar) for p in diagnosis.unknown],
        "not_judged": [_period(p, "because", calendar) for p in diagnosis.not_judged],
        "blind": [
            {
                "faults": list(b.faults),
                **_span(b, calendar),
                "because": b.because,
                "readings": list(b.readings),
            }
            for b in diagnosis.blind
        ],
        "notes": list(diagnosis.notes),
    }


def _taken(source: object, *keys: str) -> dict[str, Any]:
    """Attributes under their own names."""
    return {key: getattr(source, key) for key in keys}


def _span(found: Blind | Period | Timed, calendar: Calendar | None) -> dict[str, Any]:
    """Times in s, and as dates if the recording has them."""
    ends = {"since": found.since, "until": found.until}
    dates = {} if calendar is None else {f"{k}_time": calendar.iso(t) for k, t in ends.items()}
    return ends | dates


def _times(found: Timed, calendar: Calendar | None) -> dict[str, Any]:
    """Times of a finding, s, with dates if the recording has them."""
    own = {"duration": found.until - found.since, **_taken(found, "active", "behind")}
    return {**_taken(found, "since", "until"), **own, **_span(found, calendar)}


def _sensor(found: SensorFinding, calendar: Calendar | None) -> dict[str, Any]:
    """In the form of a finding: an invalid reading has the degree 1 and no alternatives."""
    return {
        "kind": "sensor",
        "fault": found.id,
        "module": found.module,
        "status": found.condition.status,
        **dict.fromkeys(("degree", "lower", "upper"), 1.0),
        "probability": found.probability,
        **_times(found, calendar),
        **{key: [] for key in ("alternatives", "remote", "together", "evidence")},
        **({"mended": found.mended} if found.mended else {}),
        "text": found.text,
        "action": found.condition.action,
    }


def _regime(found: RegimeFinding, calendar: Calendar | None) -> dict[str, Any]:
    """`sigma` is the largest margin of a condition, in standard uncertainties."""
    return {
        "regime": found.regime.id,
        **_taken(found.regime, "module", "status"),
        **_times(found, calendar),
        "evidence": [{"condition": text, "sigma": sure} for text, sure in found.margins],
        **_taken(found.regime, "title", "text", "action"),
    }


def _finding(ruleset: Ruleset, finding: Finding, calendar: Calendar | None) -> dict[str, Any]:
    fault = finding.fault
    return {
        "kind": "fault",
        "fault": fault.id,
        **_taken(fault, "module", "status"),
        **_taken(finding, "degree", "lower", "upper"),
        **({"unit": fault.unit} if fault.unit else {}),
        **({} if finding.growth is None else growth_form(fault, finding.growth, calendar)),
        "probability": finding.probability,
        **_times(finding, calendar),
        "alternatives": [
            {"fault": name, "probability": p, "action": ruleset.fault_by_id[name].action}
            for name, p in finding.alternatives
        ],
        **({"why_first": why} if (why := list(why_first(ruleset, finding))) else {}),
        "remote": [{"fault": name, "probability": p} for name, p in finding.remote],
        "together": list(finding.together),
        **({"step": _step(finding.step)} if finding.step is not None else {}),
        "evidence": [_taken(e, *EVIDENCE) for e in finding.evidence],
        **({"from_sheet": True} if finding.from_sheet else {}),
        **({"events": _events(finding.events)} if finding.events is not None else {}),
        "text": finding.text,
        "action": actions(ruleset, finding),
    }


def growth_form(fault: FaultSpec, growth: Growth, calendar: Calendar | None) -> dict[str, Any]:
    """Present degree of a fault, its rate, and the degree that it reaches between two times, s."""
    seconds, name = growth.per
    form: dict[str, Any] = {
        "now": {"degree": growth.degree, "lower": growth.lower, "upper": growth.upper}
    }
    if growth.rate is not None:
        value, lower, upper = (end * seconds for end in growth.rate)
        rate = {"value": value, "lower": lower, "upper": upper}
        form["rate"] = {**rate, "unit": f"{fault.unit or 1}/{name}", "grows": growth.grows}
    if (ahead := growth.next_degree) is not None:
        ends = {"earliest": ahead.earliest, "latest": ahead.latest}
        form["reaches"] = {"degree": ahead.degree, **ends}
        if calendar is not None:
            form["reaches"] |= {f"{key}_time": calendar.iso(time) for key, time in ends.items()}
    return form


def _events(events: Events) -> dict[str, Any]:
    """Times in s, set points in SI: smallest and largest value of each input."""
    return {
        **_taken(events, "count", "duration", "share"),
        "set_point": {name: [low, high] for name, (low, high) in events.settings.items()},
    }


def _step(step: Step) -> dict[str, Any]:
    """Values of inputs in SI, distances in standard deviations, times in s."""
    return {
        "changes": [{"input": name, "from": a, "to": b} for name, a, b in step.changes],
        "apart": [{"fault": name, "now": now, "then": then} for name, now, then in step.apart],
        "ramp": step.ramp,
        "hold": step.dwell,
        "costs_product": list(step.costs),
        "text": step.text,
    }


def _period(period: Period, key: str, calendar: Calendar | None) -> dict[str, Any]:
    off = [{"residual": r, "share": size, "threshold": t} for r, size, t in period.off]
    return {
        **_span(period, calendar),
        key: period.text,
        **({"disagree": off} if off else {}),
        **({"from_sheet": True} if period.from_sheet else {}),
    }


def trace_csv(trace: Trace) -> str:
    """One row per sample: time, verdict, and per fault degree, lower and upper bound."""
    header = ["time [s]", "verdict"]
    for name in trace.faults:
        header += [name, f"{name} lower", f"{name} upper"]
    lines = [row_of(header)]
    for i, (time, verdict) in enumerate(zip(trace.time, trace.verdict, strict=True)):
        row = [f"{time:.10g}", verdict]
        for j in range(len(trace.faults)):
            row += [f"{v[j, i]:.5g}" for v in (trace.degree, trace.lower, trace.upper)]
        lines.append(",".join(row))
    return "\n".join(lines) + "\n"
