"""Where and when a mismatch shows: between two values of a reading, or in some periods."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.model import Variable
from rulec.mismatch.result import Region


def region_of(contribution: Array, variables: Mapping[str, Variable]) -> tuple[Region, ...]:
    """The range of one variable in which a mismatch shows.

    Parameters
    ----------
    contribution : shape (n,), part of each sample in the mismatch, not negative; NaN: unknown.
    variables : by id, courses of shape (n,).
    """
    known = np.isfinite(contribution)
    total = float(np.sum(contribution[known]))
    if total <= 0:
        return ()
    best: tuple[float, Region] | None = None
    for name, variable in variables.items():
        ends = best_interval(variable.course[known], contribution[known] / total)
        if ends is None:
            continue
        gain, low, high, share = ends
        shown = [None if v is None else float(variable.shown(v)) for v in (low, high)]
        if best is None or gain > best[0] + limits.REGION_CLEARER:
            best = (gain, Region(name, shown[0], shown[1], variable.unit, share))
    return (best[1],) if best is not None and best[0] > limits.REGION_TELLING else ()


def best_interval(
    values: Array, shares: Array
) -> tuple[float, float | None, float | None, float] | None:
    """Interval with most of the mismatch in few of the points; None where nothing varies.

    `values` of a reading and `shares` of the mismatch have shape (n,). Returns the index, both ends
    (None: open) and the share inside.

    Source: Youden 1950 for the index.
    """
    usable = np.isfinite(values)
    values, shares = values[usable], shares[usable]
    if len(values) < limits.REGION_POINTS or np.ptp(values) == 0:
        return None
    order = np.argsort(values, kind="stable")
    values = values[order]
    inside = np.concatenate([[0.0], np.cumsum(shares[order])])
    n = len(values)
    ends = np.unique(np.linspace(0, n, limits.REGION_ENDS + 1).astype(int))
    low, high = np.meshgrid(ends, ends, indexing="ij")
    gain = np.where(high > low, (inside[high] - inside[low]) - (high - low) / n, -np.inf)
    i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
    first, last = int(ends[i]), int(ends[j])
    return (
        float(gain[i, j]),
        float(values[first]) if first else None,
        float(values[last - 1]) if last < n else None,
        float(inside[last] - inside[first]),
    )


def where_most(
    values: Array, parts: Array
) -> tuple[tuple[float | None, float | None] | None, float]:
    """Range of a reading (None: open) that contains most of the `parts`, and their share there.

    `values` and `parts`, not negative, have shape (n,). None and 0 where they are spread out.
    """
    if not parts.sum() > 0.0:
        return None, 0.0
    ends = best_interval(values, parts / parts.sum())
    if ends is None or ends[0] < limits.REGION_TELLING:
        return None, 0.0
    return (ends[1], ends[2]), ends[3]


def periods_of(time: Array, contribution: Array) -> tuple[tuple[float, float], ...]:
    """Spans of time, s, that contain most of a mismatch; none where it is spread out.

    `time`, s, and `contribution`, not negative, NaN: unknown, have shape (n,).
    """
    known = np.flatnonzero(np.isfinite(contribution))
    if len(known) < limits.PERIOD_SAMPLES or np.sum(contribution[known]) <= 0:
        return ()
    pieces = np.array_split(known, min(limits.PERIOD_PIECES, len(known) // 5))
    level = np.array([float(np.mean(contribution[p])) for p in pieces])
    high = level > limits.PERIOD_LEVEL * float(np.quantile(level, limits.PERIOD_HIGHEST))
    if high.mean() > limits.PERIOD_TIME:
        return ()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], high, [False]]).astype(int)))
    runs = edges.reshape(-1, 2).tolist()
    if (
        len(runs) > limits.PERIODS_MOST
        or sum(level[a:b].sum() for a, b in runs) < limits.PERIOD_SHARE * level.sum()
    ):
        return ()
    return tuple((float(time[pieces[a][0]]), float(time[pieces[b - 1][-1]])) for a, b in runs)
