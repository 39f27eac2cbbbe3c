"""Operating points that replace dropped rows.

A fault may last for days, and is recognized by comparison with the readings before it. For each
settled stretch the history keeps all that a diagnosis uses, so the passes judge it as if its rows
were there.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.batch_means import Halves, halves_of
from rulec_runtime.diagnosis.steady.points import Points, one_after_the_other, points_of_stretches
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches, Timeline, long_pause, timeline_of


@dataclass(frozen=True)
class History:
    """Settled stretches in order of time, shape (n,), without their samples."""

    points: Points
    halves: Halves
    timeline: Timeline

    def __len__(self) -> int:
        return len(self.timeline)


def history_of(
    recording: Recording, ruleset: Ruleset, stretches: Stretches, noise: dict[str, float]
) -> History:
    """The history of the settled stretches of a recording."""
    return History(
        points_of_stretches(recording, ruleset, stretches, noise),
        halves_of(recording, ruleset, stretches),
        timeline_of(recording.time, stretches),
    )


def joined(before: History, recording: Recording, after: History) -> History:
    """Stretches of dropped rows, then those of the recording that continues them.

    A signal that one of them lacks has no reading there.
    """
    if not len(before):
        return after
    old, new = before.points, after.points
    both = one_after_the_other([old, new])
    points = replace(
        both,
        why={**old.why, **{n: w for n, w in new.why.items() if w}},
        lag={n: part for n, part in both.lag.items() if part.any()},
    )
    first = replace(before.timeline, later=before.timeline.later + len(recording))
    second = after.timeline
    pairs = zip(_columns(first), _columns(second), strict=True)
    timeline = Timeline(*(np.concatenate(pair) for pair in pairs))
    if len(second):
        pause = second.since[0] - first.until[-1]
        timeline.paused[len(first)] = pause > long_pause(recording.time)
    halves = Halves(
        np.concatenate([before.halves.apart, after.halves.apart], axis=1),
        np.concatenate([before.halves.excess, after.halves.excess]),
    )
    return History(points, halves, timeline)


def some(history: History, chosen: np.ndarray) -> History:
    """Some of the stretches, by flags, shape (n,); a pause before a removed stretch moves to the
    next one."""
    if not len(history):
        return history
    before = history.timeline
    group = np.cumsum(np.concatenate([[0], chosen[:-1].astype(int)]))
    paused = np.zeros(group[-1] + 1, dtype=bool)
    np.logical_or.at(paused, group, before.paused)
    timeline = Timeline(*(column[chosen] for column in _columns(before)))
    timeline = replace(timeline, paused=paused[: len(timeline)])
    halves = Halves(history.halves.apart[:, chosen], history.halves.excess[chosen])
    return History(history.points.at(chosen), halves, timeline)


def _columns(timeline: Timeline) -> list[np.ndarray]:
    return [getattr(timeline, field.name) for field in fields(timeline)]
