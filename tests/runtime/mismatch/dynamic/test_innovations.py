"""Innovations of noise with an error that wanders are those of its whole covariance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz

from rulec.mismatch.search.stores.innovations import innovations


@pytest.mark.parametrize("smoothness", [1.0, 3.0])
@pytest.mark.parametrize(("size", "lasts"), [(1e-3, 10.0), (2.0, 10.0), (50.0, 200.0)])
def test_a_settled_filter_is_the_whole_covariance(
    size: float, lasts: float, smoothness: float
) -> None:
    """Two runs of samples, told apart by Cholesky's factor of each."""
    runs = [slice(0, 300), slice(300, 350)]
    readings = np.random.default_rng(1).standard_normal((350, 2)) * max(size, 1.0)
    own = innovations(size, lasts, smoothness)
    logs, found = 0.0, []
    for run in runs:
        gap = np.sqrt(smoothness) / lasts * np.arange(run.stop - run.start)
        alike = np.exp(-gap) * (1.0 + gap if smoothness > 1.0 else 1.0)
        lower = np.linalg.cholesky(size**2 * toeplitz(alike) + np.eye(len(gap)))
        found.append(np.linalg.solve(lower, readings[run]))
        logs += float(np.sum(np.log(np.diag(lower))))
    np.testing.assert_allclose(own.of(readings, runs), np.concatenate(found), atol=1e-4)
    assert own.logs(runs) == pytest.approx(logs, abs=1e-6)
