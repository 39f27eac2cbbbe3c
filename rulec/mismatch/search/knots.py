"""A course in time by a few values that it passes through: as many as pay for themselves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust import spread_about

from rulec.mismatch.search import limits


def levels_of(course: Array, weight: Array) -> Array:
    """Knots of a course that passes from one to the next: as many as pay for themselves.

    Source: Schwarz 1978, with free scale.
    """
    n, near = len(course), clipped(course)
    best: tuple[float, Array] | None = None
    for count, levels, table in knotted(course, weight):
        left = float(np.sum(weight * (near - table @ levels) ** 2))
        cost = 0.5 * (n * float(np.log(left + 1e-300)) + count * float(np.log(n)))
        if best is None or cost < best[0]:
            best = (cost, levels)
    assert best is not None
    return best[1]


def knotted(course: Array, weight: Array) -> Iterator[tuple[int, Array, Array]]:
    """Numbers of knots, their values, and how much of each there is at every point."""
    n, root = len(course), np.sqrt(weight)
    # One point far off must not draw the course to it.
    near = clipped(course)
    for count in limits.LATENT_KNOTS:
        if count > max(n // limits.KNOT_POINTS, 2):
            break
        at = np.linspace(0.0, count - 1.0, n)
        table = np.maximum(1.0 - np.abs(at[:, None] - np.arange(count)), 0.0)
        yield count, np.linalg.lstsq(table * root[:, None], near * root, rcond=None)[0], table


def clipped(values: Array) -> Array:
    """One odd point is no course."""
    middle = float(np.median(values))
    spread = spread_about(values, middle) or float(np.std(values))
    near: Array = np.clip(
        values, middle - limits.KNOT_ODD * spread, middle + limits.KNOT_ODD * spread
    )
    return near
