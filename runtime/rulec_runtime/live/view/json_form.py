"""A moment as JSON, for programs."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.words import modules
from rulec_runtime.output.terminal import machine_text
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
    return {
        "number": event.number,
        "time": event.time,
        **_dates(now.calendar, time=event.time),
        "what": event.what,
        "text": event.text,
        "episode": _episode(now, event.episode),
    }


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
