"""Moments of a plant, made of diagnoses of the shipped examples; one full of hostile texts."""

import functools
from dataclasses import fields, is_dataclass, replace
from time import monotonic
from typing import Any

import numpy as np
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live.changes import Horizon, episodes_of
from rulec_runtime.live.episode import Episode, Event, What
from rulec_runtime.live.moment import Now
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.recording import read_recording

from tests.conftest import ROOT, compiled
from tests.hostile.texts import MARKUP, STEERING
from tests.rig.follower.plants import first_rows

CALENDAR = Calendar(1_790_000_000.0, ((0.0, 7200.0),))
KINDS = ("sensor", "fault", "unknown", "blind")


@functools.cache
def diagnosed(name: str, rows: int = 9999, stuck: str = "") -> Diagnosis:
    """What the first rows of an example say; one reading may stand still from half of them on."""
    whole = read_recording(ROOT / "plants" / "abc" / "examples" / name, compiled("abc"))
    recording = replace(first_rows(whole, rows), calendar=CALENDAR)
    if stuck:
        values = np.array(recording.values[stuck])
        values[len(values) // 2 :] = values[len(values) // 2]
        recording = replace(recording, values={**recording.values, stuck: values})
    return diagnose(recording, compiled("abc"))


def now_of(diagnosis: Diagnosis) -> Now:
    """The moment of the last row of what was diagnosed: all that lasts is told, however short."""
    time = 59.0 if diagnosis.samples <= 60 else 79.0
    horizon = Horizon(np.array([time, time]), -np.inf)
    found = tuple(sorted(episodes_of(diagnosis, horizon), key=lambda e: KINDS.index(e.kind)))
    events = [_event(e, "began", e.since) for e in found]
    events += [_event(e, "ended", e.until) for e in found if not e.active]
    events.sort(key=lambda e: e.time)
    letters = {e.status for e in found if e.active}
    return Now(
        plant=diagnosis.ruleset.plant,
        title=diagnosis.ruleset.title,
        time=time,
        calendar=diagnosis.calendar,
        status=next((x for x in "FCSM" if x in letters), "ok"),
        source="opc.tcp://plant.example:4840",
        connected=True,
        remark="",
        rows=diagnosis.samples,
        active=tuple(e for e in found if e.active),
        past=tuple(replace(e, number=i + 1) for i, e in enumerate(events))[::-1],
        acknowledged=frozenset(e.id for e in found[:1] if not e.active),
        diagnosis=diagnosis,
        came=monotonic(),
    )


def _event(episode: Episode, what: What, time: float) -> Event:
    text = f"{episode.subject} {episode.degree:.3f}" if episode.kind == "fault" else episode.text
    return Event(number=0, time=time, what=what, text=text, episode=episode)


def leaking() -> Now:
    """A leakage that grows; two smaller ones are past."""
    return now_of(diagnosed("leakage_A.csv", 58))


def failing() -> Now:
    """A leakage, and a reading that stands still: not all can be judged."""
    return now_of(diagnosed("leakage_A.csv", 58, "B.dp"))


def healthy() -> Now:
    """Nothing is wrong."""
    return now_of(diagnosed("healthy.csv"))


def before() -> Now:
    """Nothing has come yet."""
    nothing = replace(
        healthy(), time=None, calendar=None, rows=0, diagnosis=None, past=(), came=None
    )
    return replace(nothing, connected=False, remark="connection refused", status="C")


PAGE = [
    "<script>window.pwned=1</script>",
    '"><img src=x onerror=window.pwned=1>',
    "'><svg onload=window.pwned=1>",
    "</style><b id=pwned>x</b>",
    "]]>--><b id=pwned>x</b>",
    "\ndata: <b id=pwned>x</b>\n\nevent: now",
]
"""Markup and breaks that a page or a stream of events may fall for."""

TEXTS = [*STEERING.values(), *MARKUP, *PAGE, "\u200f\u202ex", "e\u0301" * 40, "漢" * 30, "x" * 5000]

KEPT = {"id", "kind", "status", "what", "subject", "unit"}
"""What links the parts of a moment, or is one of few words."""


def hostile(text: str) -> Now:
    """The same text before every text of a moment: of episodes, events, plant and source."""
    now = failing()
    parts = {
        f.name: _with(getattr(now, f.name), text) for f in fields(now) if f.name != "diagnosis"
    }
    assert now.diagnosis is not None
    diagnosis = now.diagnosis
    ruleset = replace(
        diagnosis.ruleset,
        title=text + diagnosis.ruleset.title,
        modules={text + name: text + title for name, title in diagnosis.ruleset.modules.items()},
        unobserved=(text,),
    )
    findings = tuple(
        replace(f, text=text + f.text, fault=replace(f.fault, action=text, meaning=text))
        for f in diagnosis.findings
    )
    periods = tuple(replace(p, text=text + p.text) for p in diagnosis.not_judged)
    parts["status"] = now.status
    parts["remark"] = text
    parts["diagnosis"] = replace(
        diagnosis, ruleset=ruleset, findings=findings, not_judged=periods, notes=(text,)
    )
    first, *others = parts["active"]
    strange = replace(first, id=text, subject=text, unit=text, alternatives=((text, 0.4),))
    parts["active"] = (strange, replace(strange, id=f"{text}2", kind="fault"), *others)
    return Now(**parts)


def _with(value: Any, text: str) -> Any:
    if isinstance(value, str):
        return text + value
    if isinstance(value, tuple):
        return tuple(_with(part, text) for part in value)
    if is_dataclass(value) and not isinstance(value, type) and type(value).__name__ != "Calendar":
        kept = {f.name: getattr(value, f.name) for f in fields(value)}
        return replace(value, **{k: v if k in KEPT else _with(v, text) for k, v in kept.items()})
    return value
