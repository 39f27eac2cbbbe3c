"""Sensors that stand still or move in coarse steps, told from plants at rest."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.recordings.piecewise import runs_of_same
from rulec_runtime.recordings.standing_still import standing_still

from rulec.mismatch.evidence.failing_sensors import coarse_step

COURSE = 3.0 + np.sin(np.arange(600) / 40.0)
NOISY = np.round(COURSE + 0.02 * np.random.default_rng(1).standard_normal(600), 3)


def test_a_reading_that_loses_its_noise_is_stuck() -> None:
    for behind in (215, 260):
        stuck = NOISY.copy()
        stuck[200:behind] = stuck[200]
        assert [(200, behind)] == standing_still(stuck)


def test_a_reading_that_is_often_the_same_is_not_stuck() -> None:
    """Noise of a third of a step repeats itself by chance, for 25 readings here; a smooth course
    that is rounded stands still by itself, and so does a clipped one; as does a plateau on which
    noise is half a digit, after one on which it is three digits."""
    quiet = np.round(3.0 + 0.35 * np.random.default_rng(2).standard_normal(600))
    rest = np.round(np.minimum(COURSE, 3.4), 2)
    rest = np.concatenate([rest, np.full(100, rest[-1])])
    random = np.random.default_rng(4)
    loud, faint = random.normal(0.0, 3.0, 600), random.normal(0.0, 0.22, 600)
    plateau = np.round(np.concatenate([100.0 + loud, 120.0 + faint]))
    assert max(b - a for a, b in runs_of_same(plateau, 1)[0]) > 40
    for values in (NOISY, quiet, rest, np.minimum(NOISY, 3.4), plateau):
        assert standing_still(values) == []


def test_a_coarse_display_is_told_by_its_step() -> None:
    many = np.round(3.0 * NOISY / 0.1) * 0.1
    assert len(np.unique(many)) > 40
    assert coarse_step(np.round(NOISY / 0.4) * 0.4, 0.025) == pytest.approx(0.4)
    assert coarse_step(many, 0.01) == pytest.approx(0.1)
    assert coarse_step(NOISY, 0.025) == 0.0
    assert coarse_step(np.where(COURSE > 3.0, 1.0, 0.0), 0.025) == 0.0
