"""Regimes: ways of running, such as dry, that the delivery laws of a module do not cover.

Each settled stretch is checked against the conditions of its module type, by mean readings with
their uncertainties (GUM); consecutive stretches are one finding.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import RegimeSpec, Ruleset
from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.steady.observe import plan_inputs
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.recordings.columns import runs_where
from rulec_runtime.recordings.plant_calendar import ENDED, TO_THE_END, UNSETTLED
from rulec_runtime.recordings.stationary import Timeline


@dataclass(frozen=True, kw_only=True)
class RegimeFinding:
    """A regime over a period; times in s. `behind` says what follows it, as for a finding.

    `margins` give by how many standard uncertainties each condition holds that is no comparison
    with a minimum, at the stretch where the weakest of them holds most.
    """

    regime: RegimeSpec
    since: float
    until: float
    behind: str | None
    margins: tuple[tuple[str, float], ...]

    @property
    def active(self) -> bool:
        """Whether it was still there when it was last detectable."""
        return self.behind is not ENDED


def regimes_of(ruleset: Ruleset, timeline: Timeline, points: Points) -> tuple[RegimeFinding, ...]:
    """All regimes of a recording by its settled stretches, one point each."""
    if not (ruleset.regimes and len(points)):
        return ()
    found, out = [], _margins(ruleset, points)
    for regime in ruleset.regimes:
        there, sure = _fulfilled(ruleset, regime, points, out)
        for first, behind in _rows(there, timeline):
            if timeline.samples[first:behind].sum() >= limits.PERSISTENCE:
                found.append(_finding(regime, timeline, sure, first, behind - 1))
    return tuple(found)


def _margins(ruleset: Ruleset, points: Points) -> dict[str, Array]:
    """Margins of all conditions over their standard uncertainties, shape (n,) each; NaN where a
    reading that they need was not recorded."""
    names = [c.margin for regime in ruleset.regimes for c in regime.when if c.margin]
    outputs = (f"{kind}:{name}" for kind in ("margin", "u_margin") for name in names)
    plan = ruleset.plan.select(outputs)
    lacking: dict[str, Array | float] = dict.fromkeys(plan.used_inputs, np.nan)
    out = plan.run(lacking | plan_inputs(points))
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = {name: out[f"margin:{name}"] / out[f"u_margin:{name}"] for name in names}
    return {name: np.broadcast_to(share, (len(points),)) for name, share in shares.items()}


def _fulfilled(
    ruleset: Ruleset, regime: RegimeSpec, points: Points, out: Mapping[str, Array]
) -> tuple[np.ndarray, dict[str, Array]]:
    """Stretches in which a regime holds, shape (n,), and margins of its conditions, (n,) each."""
    there, sure = np.ones(len(points), dtype=bool), {}
    nothing = np.full(len(points), np.nan)
    with np.errstate(invalid="ignore"):
        for condition in regime.when:
            if condition.signal:
                readings = points.values.get(condition.signal, nothing)
                minimum = ruleset.signal_by_id[condition.signal].minimum
                there &= readings >= minimum if condition.above else readings < minimum
            else:
                sure[condition.text] = out[condition.margin]
                there &= out[condition.margin] > threshold_of(1.0)
    return there, sure


def _rows(there: np.ndarray, timeline: Timeline) -> Iterator[tuple[int, int]]:
    """First and end (excluded) of consecutive stretches in which something holds; a long pause ends
    a row."""
    for first, last in runs_where(there, 1):
        pauses = first + 1 + np.flatnonzero(timeline.paused[first + 1 : last])
        yield from pairwise([first, *pauses.tolist(), last])


def _finding(
    regime: RegimeSpec, timeline: Timeline, sure: dict[str, Array], first: int, last: int
) -> RegimeFinding:
    behind: str | None = ENDED
    if last + 1 == len(timeline):
        behind = TO_THE_END if timeline.later[last] < limits.PERSISTENCE else UNSETTLED
    rows = slice(first, last + 1)
    least = np.min([each[rows] for each in sure.values()], axis=0) if sure else np.zeros(1)
    best = first + int(np.argmax(least))
    return RegimeFinding(
        regime=regime,
        since=float(timeline.since[first]),
        until=float(timeline.until[last]),
        behind=behind,
        margins=tuple((text, float(each[best])) for text, each in sure.items()),
    )
