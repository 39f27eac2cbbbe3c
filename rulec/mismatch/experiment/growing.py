"""What is known of an explanation with the doubt about when its faults began to grow.

A later beginning asks for a faster growth, and the later a reading, the farther these are apart.
With the beginning held, what grows would be foretold too surely.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.linalg import block_diag

from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.onset import slope_by_onset
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.settled.posterior_curve import solved


def known_with_onsets(geometry: Geometry, model: Model) -> Array:
    """Covariance of all numbers of a model and, behind them, of when each fault that grows began,
    s, shape (numbers, numbers). Before the recording each time in it is as likely."""
    slopes = slopes_by_onsets(model.fitted)[geometry.seen]
    length = max(float(np.ptp(geometry.rows.system.data.time)), 1e-300)
    before = np.full(slopes.shape[1], 12.0 / length**2)
    wide = replace(
        model,
        table=np.concatenate([model.table, slopes], axis=1),
        precision=block_diag(model.precision, np.diag(before)),
    )
    return solved(wide)[1]


def slopes_by_onsets(fitted: Fitted) -> Array:
    """Slopes of all residuals by when each fault that grows began, 1/s, shape (rows, faults)."""
    growing = [course for course in fitted.setting.courses if course.grows]
    at = [fitted.prior.names.index(course.names()[0]) for course in growing]
    found = [slope_by_onset(fitted, course, i) for course, i in zip(growing, at, strict=True)]
    return np.stack(found, axis=1) if found else np.zeros((len(fitted.residual), 0))
