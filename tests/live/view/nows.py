"""Moments of a plant, made of diagnoses of the shipped examples."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live.episode import Episode, Event, What
from rulec_runtime.live.horizon import Horizon, episodes_of
from rulec_runtime.live.now import Now
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.recordings.wall_clock import Calendar

from tests.conftest import ROOT, compiled
from tests.rig.follower.agreement import first_rows

CALENDAR = Calendar(1_790_000_000.0, ((0.0, 7200.0),))


@functools.cache
def recorded(name: str, rows: int) -> Recording:
    """The first rows of a shipped example."""
    whole = read_recording(ROOT / "plants" / "abc" / "examples" / name, compiled("abc"))
    return replace(first_rows(whole, rows), calendar=CALENDAR)


@functools.cache
def diagnosed(name: str, rows: int = 9999, stuck: str = "") -> Diagnosis:
    """What its first rows say; one reading may stand still from half of them on."""
    recording = recorded(name, rows)
    if stuck:
        values = np.array(recording.values[stuck])
        values[len(values) // 2 :] = values[len(values) // 2]
        recording = replace(recording, values={**recording.values, stuck: values})
    return diagnose(recording, compiled("abc"))


def episodes(diagnosis: Diagnosis, until: float) -> Iterator[Episode]:
    """What a diagnosis tells that lasts, however short, at the time of its last row."""
    since = -np.inf
    times = np.array([since, until])
    sight = Horizon(since=since, until=until, settled=since, usual=since, time=times, pause=1)
    yield from episodes_of(diagnosis, sight)


def now_of(diagnosis: Diagnosis, **changed: object) -> Now:
    """The moment of the last row of what was diagnosed."""
    time = 59.0 if diagnosis.samples <= 60 else 79.0
    kinds = ("sensor", "fault", "unknown", "blind")
    found = tuple(sorted(episodes(diagnosis, time), key=lambda e: kinds.index(e.kind)))
    events = [_event(e, "began", e.since) for e in found]
    events += [_event(e, "ended", e.until) for e in found if not e.active]
    events.sort(key=lambda e: e.time)
    past = tuple(replace(e, number=i + 1) for i, e in enumerate(events))[::-1]
    letters = {e.status for e in found if e.active}
    now = Now(
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
        past=past,
        acknowledged=frozenset(e.id for e in found[:1] if not e.active),
        diagnosis=diagnosis,
    )
    return replace(now, **changed)  # type: ignore[arg-type]


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
    return replace(
        healthy(),
        time=None,
        calendar=None,
        rows=0,
        diagnosis=None,
        past=(),
        connected=False,
        remark="connection refused",
        status="C",
    )
