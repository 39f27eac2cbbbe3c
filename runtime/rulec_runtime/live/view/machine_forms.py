"""A moment for programs: as JSON, and as OpenMetrics text for monitoring tools."""

import dataclasses
import json
import math
from collections.abc import Callable
from typing import Any

from rulec_runtime.live.episode import Episode, Event, form_of
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.words import modules
from rulec_runtime.output.terminal import machine_text, one_line
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.report.json_form import diagnosis_form


def now_form(now: Now, age: float | None) -> dict[str, Any]:
    """A moment as JSON data; times in s as of rows, `age` in s since the last row came."""
    date = {"date": now.calendar.iso(now.time)} if now.calendar and now.time is not None else {}
    return {
        "plant": now.plant,
        "title": now.title,
        "status": now.status,
        "modules": {name: letter for name, _, letter in modules(now)},
        "time": now.time,
        **date,
        "rows": now.rows,
        "age": age,
        "source": now.source,
        "connected": now.connected,
        "remark": now.remark,
        "active": [_episode(now, episode) for episode in now.active],
        "residuals": _residuals(now),
        "past": [_event(now, event) for event in now.past],
        "diagnosis": diagnosis_form(now.diagnosis) if now.diagnosis else None,
    }


def now_text(now: Now, age: float | None) -> str:
    """The same as JSON text; numbers that are not finite are null."""
    form = _finite(now_form(now, age))
    return machine_text(json.dumps(form, ensure_ascii=False, allow_nan=False) + "\n")


def _residuals(now: Now) -> dict[str, Any] | None:
    """Residuals of the last settled stretch or window; flows in m3/s, readings in SI."""
    if now.diagnosis is None or now.diagnosis.latest is None:
        return None
    latest, names = now.diagnosis.latest, ("residual", "value", "u", "threshold", "verdict")
    residuals = [{name: getattr(one, name) for name in names} for one in latest.residuals]
    form = {"since": latest.since, "until": latest.until, "residuals": residuals}
    return {**form, **_dates(now.calendar, until=latest.until)}


def _episode(now: Now, episode: Episode) -> dict[str, Any]:
    form = dataclasses.asdict(episode)
    form["alternatives"] = [{"fault": n, "probability": p} for n, p in episode.alternatives]
    form["acknowledged"] = episode.id in now.acknowledged
    return {**form, **_dates(now.calendar, since=episode.since, until=episode.until)}


def _event(now: Now, event: Event) -> dict[str, Any]:
    form = form_of(event, now.plant, now.calendar)
    form["episode"]["acknowledged"] = event.episode.id in now.acknowledged
    return form


def _dates(calendar: Calendar | None, **times: float) -> dict[str, str]:
    if calendar is None:
        return {}
    return {f"{name}_date": calendar.iso(time) for name, time in times.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    return [_finite(part) for part in value] if isinstance(value, list | tuple) else value


TYPE = "application/openmetrics-text; version=1.0.0; charset=utf-8"

STATES = ("ok", "M", "S", "C", "F")
"""NE 107, the least urgent first."""

Samples = list[tuple[dict[str, str], float]]
"""Samples of a metric: labels and value."""

FINDING: dict[str, tuple[str, Callable[[Now, Episode], float]]] = {
    "degree": ("Degree of an active finding", lambda _, e: e.degree),
    "degree_lower": ("Lower 95 % bound of the degree", lambda _, e: e.lower),
    "degree_upper": ("Upper 95 % bound of the degree", lambda _, e: e.upper),
    "rate": ("Growth of the degree of an active finding per second", lambda _, e: e.rate),
    "probability": ("Probability of an active finding", lambda _, e: e.probability),
    "acknowledged": ("1 if somebody has taken note of it", lambda n, e: e.id in n.acknowledged),
}
"""Gauges of active findings: meaning and value."""


def metrics(now: Now, age: float | None) -> str:
    """Status of plant and modules, active findings, and rows received.

    Source: OpenMetrics 1.0.0; a status is a StateSet, one of whose samples is 1.
    """
    plant = {"plant": now.plant}
    series: dict[tuple[str, ...], tuple[dict[str, str], Episode]] = {}
    for e in now.active:
        # Other subjects are texts, each of which would become a separate series.
        subject = e.subject if e.kind in ("fault", "sensor", "regime") else ""
        own = {**plant, "kind": e.kind, "subject": subject, "module": e.module}
        own |= {"status": e.status, "unit": e.unit}
        # Two episodes with the same labels would duplicate a series: the worst comes first.
        series.setdefault(tuple(own.values()), (own, e))
    of_modules = [({**plant, "module": name}, letter) for name, _, letter in modules(now)]
    old: Samples = [] if age is None else [(plant, age)]
    lines = [
        *_states("rulec_plant_status", "NE 107 status of the plant", [(plant, now.status)]),
        *_states("rulec_module_status", "NE 107 status of a module", of_modules),
    ]
    for name, (text, value) in FINDING.items():
        samples = [(labels, value(now, e)) for labels, e in series.values()]
        lines += _metric(f"rulec_finding_{name}", "gauge", text, samples)
    text = "Rows of readings that have come"
    lines += _metric("rulec_rows", "counter", text, [(plant, now.rows)], ending="_total")
    text = "1 while rows come from the source"
    lines += _metric("rulec_connected", "gauge", text, [(plant, now.connected)])
    text = "How long ago the last row came"
    lines += _metric("rulec_last_row_age_seconds", "gauge", text, old, unit="seconds")
    return "\n".join([*lines, "# EOF"]) + "\n"


def _states(name: str, text: str, states: list[tuple[dict[str, str], str]]) -> list[str]:
    each = [({**labels, name: one}, float(one == own)) for labels, own in states for one in STATES]
    return _metric(name, "stateset", text, each)


def _metric(
    name: str, kind: str, text: str, samples: Samples, *, unit: str = "", ending: str = ""
) -> list[str]:
    lines = [f"# TYPE {name} {kind}", *([f"# UNIT {name} {unit}"] if unit else ())]
    lines.append(f"# HELP {name} {text}")
    for labels, value in samples:
        texts = (one_line(v).replace("\\", "\\\\").replace('"', '\\"') for v in labels.values())
        pairs = ",".join(f'{label}="{shown}"' for label, shown in zip(labels, texts, strict=True))
        number = f"{float(value):.10g}".replace("nan", "NaN").replace("inf", "Inf")
        lines.append(f"{name}{ending}{{{pairs}}} {number}")
    return lines
