"""A full update: the passes of a recording, over all rows and operating points in memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, assembled, restless, together
from rulec_runtime.diagnosis.sensors.judge import Health, examine
from rulec_runtime.diagnosis.steady.courses import found_of
from rulec_runtime.diagnosis.steady.evaluated_points import (
    EvaluatedPoints,
    evaluate_points,
    judgeable,
)
from rulec_runtime.diagnosis.steady.findings import Found, Period
from rulec_runtime.live import limits
from rulec_runtime.live.history import History, history_of, joined
from rulec_runtime.live.horizon import Horizon
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches


@dataclass(frozen=True, kw_only=True)
class FullUpdate:
    """The result of a full update.

    Attributes
    ----------
    whole : all operating points in memory.
    stretches : settled stretches of the latest rows; `noise` of readings within them, SI.
    health : of the sensors.
    seen, found : per part of the plant, the evaluated points and the findings.
    """

    whole: History
    stretches: Stretches
    noise: Mapping[str, float]
    health: Health
    seen: tuple[EvaluatedPoints, ...]
    found: tuple[Found, ...]


def full_update(
    ruleset: Ruleset, recent: Recording, before: History | None, *, headers: bool
) -> tuple[Diagnosis, FullUpdate | None]:
    """Judge a plant that settles by the whole memory; no `FullUpdate` if nothing settled.

    `headers`: whether to check for columns that do not match their headers.
    """
    health = examine(recent, ruleset, headers=headers)
    recording = health.recording
    stretches, noise = judgeable(recording, ruleset, "default")
    own = history_of(recording, ruleset, stretches, noise)
    whole = own if before is None else joined(before, recording, own)
    if not len(whole):
        since, until = float(recording.time[0]), float(recording.time[-1])
        found = Found([], [], [Period(since, until, restless(len(recording)))])
        return assembled(health, ruleset, "default", judged=0, found=found), None
    seen = evaluate_points(ruleset, whole.points, whole.halves, "default")
    each = tuple(found_of(whole.timeline, ruleset, part) for part in seen)
    samples, found = together(ruleset, whole.timeline, seen, each)
    found.not_judged.extend(unsettled(recording, whole))
    diagnosis = assembled(health, ruleset, "default", judged=samples, found=found)
    return diagnosis, FullUpdate(
        whole=whole,
        stretches=stretches,
        noise=noise,
        health=health,
        seen=tuple(seen),
        found=each,
    )


def unsettled(recording: Recording, whole: History) -> Iterator[Period]:
    """Rows after the last stretch, if there are too many for a move to an operating point."""
    rows = int(whole.timeline.later[-1])
    if rows >= limits.BLIND_ROWS:
        text = "the plant does not settle: readings jump or move too fast"
        first = max(len(recording) - rows, 0)
        yield Period(float(recording.time[first]), float(recording.time[-1]), text)


def horizon_of(time: Array, settled: float | None) -> Horizon:
    """The horizon of a diagnosis of rows at these times, s, shape (n,); `settled` is the time of
    the last settled row, if there is any."""
    interval = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    return Horizon(
        since=float(time[0]),
        until=float(time[-1]),
        settled=float(time[-1]) if settled is None else settled,
        usual=limits.BLIND_ROWS * interval,
        time=time,
        pause=common.SETTLING,
    )
