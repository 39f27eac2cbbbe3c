"""How much an error of a simulation says: its memory, its innovations, and what it gains."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.recordings.robust_statistics import memory_of
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from rulec.mismatch.evidence.stores.noise import (
    Noise,
    gain,
    innovations,
    noise_of,
    score_covariance,
)

N = 20_000
ALL = np.ones(N, dtype=bool)


@pytest.mark.parametrize(("rho", "expected"), [(0.0, 1.0), (0.9, 1.81 / 0.19)])
def test_memory_of_a_fading_error(rho: float, expected: float) -> None:
    """The sum of squared correlations of an AR(1) process is (1 + rho**2)/(1 - rho**2), also where
    blocks are held out, which are no zeros; that of white noise is 1 to the last digit."""
    error = lfilter([1.0], [1.0, -rho], np.random.default_rng(1).standard_normal(N))
    assert memory_of(error, ALL) == pytest.approx(expected, rel=0.2 if rho else 0.0)
    known = (np.arange(N) // 400) % 5 != 2
    assert memory_of(error, known) == pytest.approx(memory_of(error, ALL), rel=0.15)


def test_noise_that_lasts_is_counted() -> None:
    """The doubt of a mean in noise of first order: (1 + r)/(1 - r) times that of white noise."""
    error = lfilter([1.0], [1.0, -0.8], np.random.default_rng(1).standard_normal(N))
    ratio = float(score_covariance(np.ones((N, 1)), error, ALL)[0, 0]) / N
    assert ratio == pytest.approx(1.8 / 0.2, rel=0.15)


def test_what_an_error_says() -> None:
    """Nothing is finer than the resolution. Half the error in 1000 samples of memory 10 gains
    100 ln 2."""
    assert Noise(0.01, 1.0) == noise_of(np.zeros(100), np.ones(100, dtype=bool), 0.01)
    assert gain(Noise(2.0, 50.0), Noise(1.0, 10.0), 1000) == pytest.approx(100 * np.log(2.0))


@pytest.mark.parametrize("smoothness", [1.0, 3.0])
@pytest.mark.parametrize(("size", "lasts"), [(1e-3, 10.0), (50.0, 200.0)])
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
