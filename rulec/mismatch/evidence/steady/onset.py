"""The onset of a growing fault, as one more value of a fit.

The residuals have a kink at the onset and depend on it smoothly elsewhere, so it has a slope like
any other value. With the onset held, rate and degree would seem too certain: a later onset needs a
higher rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.configuration import Course
from rulec.mismatch.evidence.steady.fit import Fitted


@dataclass(frozen=True)
class Onset:
    """Standard uncertainties of the final degree of a growing fault, of its onset, s, and of its
    rate, 1/s, and the Gauss-Newton `step` of the onset, s."""

    u_degree: float
    u_since: float
    u_rate: float
    step: float


def onset_of(fitted: Fitted, course: Course) -> Onset:
    """Linearise degree and onset together, with all other values refitted."""
    (span,), (name,) = course.periods, course.names()
    at = fitted.prior.names.index(name)
    value, length = fitted.setting.values[name], span.until - span.since
    slope = slope_by_onset(fitted, course, at)
    table = np.column_stack([fitted.jacobian, slope])
    half = table * np.sqrt(fitted.weights)[:, None]
    normal = half.T @ half
    known = fitted.known
    normal[:-1, :-1] += known.precision
    normal[-1, -1] += 1e-12 / length**2
    gradient = table.T @ (fitted.weights * fitted.residual)
    gradient[:-1] += known.precision @ (fitted.at - known.mean)
    size = np.sqrt(np.diag(normal))
    inverse = np.linalg.pinv(normal / np.outer(size, size), hermitian=True) / np.outer(size, size)
    both = inverse[np.ix_([at, -1], [at, -1])]
    by_both = np.array([1.0 / length, value / length**2])
    return Onset(
        u_degree=float(np.sqrt(both[0, 0])),
        u_since=float(np.sqrt(both[1, 1])),
        u_rate=float(np.sqrt(by_both @ both @ by_both)),
        step=-float(inverse[-1] @ gradient),
    )


def slope_by_onset(fitted: Fitted, course: Course, at: int) -> Array:
    """Slopes of the residuals by the onset, shape (rows,), 1/s; `at` is the index of the degree
    among the values."""
    (span,), (name,) = course.periods, course.names()
    assert course.risen is not None
    time, length = fitted.rows.system.data.time, span.until - span.since
    by_onset = np.where(course.risen > 0.0, (time - span.until) / length**2, 0.0)
    share = np.where(course.risen > 0.0, course.risen, 1.0)
    whole = fitted.jacobian[:, at] / share[fitted.rows.point]
    return np.asarray(fitted.setting.values[name] * whole * by_onset[fitted.rows.point])
