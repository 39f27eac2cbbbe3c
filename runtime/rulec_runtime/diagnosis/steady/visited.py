"""A few operating points of a recording, which are kept when the recording is gone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.stack import thinned
from rulec_runtime.recordings.stationary import Timeline


@dataclass(frozen=True, kw_only=True)
class Visited:
    """Mean readings of some settled stretches, spread evenly over those that were judged.

    `since`, `until` (s) and `samples` of each, shape (n,); `values` and standard uncertainties `u`
    per signal, shape (n,), SI.
    """

    since: Array
    until: Array
    samples: np.ndarray
    values: Mapping[str, Array]
    u: Mapping[str, Array]


def visited_of(timeline: Timeline, points: Points, judged: np.ndarray) -> Visited:
    """Points of a recording by flags of what was judged, shape (points,)."""
    some = thinned(np.flatnonzero(judged), limits.VISITED)
    own = points.at(some)
    return Visited(
        since=timeline.since[some],
        until=timeline.until[some],
        samples=timeline.samples[some],
        values=own.values,
        u=own.u,
    )
