"""How much an error of a simulation says."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.recordings.autocorrelation_time import memory_of
from scipy.signal import lfilter

from rulec.mismatch.evidence.stores.noise import Noise, gain, noise_of

N = 20_000
ALL = np.ones(N, dtype=bool)


def test_white_noise_says_something_new_each_time() -> None:
    error = np.random.default_rng(0).standard_normal(N)
    assert 1.0 == memory_of(error, ALL)


@pytest.mark.parametrize("rho", [0.5, 0.9, 0.98])
def test_memory_of_a_fading_error(rho: float) -> None:
    """The sum of squared correlations of an AR(1) process is (1 + rho**2)/(1 - rho**2)."""
    white = np.random.default_rng(1).standard_normal(N)
    error = lfilter([1.0], [1.0, -rho], white)
    assert memory_of(error, ALL) == pytest.approx((1 + rho**2) / (1 - rho**2), rel=0.2)


def test_gaps_do_not_change_the_memory() -> None:
    """Blocks that are held out are no zeros."""
    error = lfilter([1.0], [1.0, -0.9], np.random.default_rng(2).standard_normal(N))
    known = (np.arange(N) // 400) % 5 != 2
    assert memory_of(error, known) == pytest.approx(memory_of(error, ALL), rel=0.15)


def test_nothing_is_finer_than_the_resolution() -> None:
    found = noise_of(np.zeros(100), np.ones(100, dtype=bool), 0.01)
    assert Noise(0.01, 1.0) == found


def test_gain_counts_pieces_of_news() -> None:
    """Half the error in 1000 samples of memory 10: 100 ln 2."""
    assert gain(Noise(2.0, 50.0), Noise(1.0, 10.0), 1000) == pytest.approx(100 * np.log(2.0))
