"""Systems of outputs in units of their own are solved; singular ones are told."""

from __future__ import annotations

import numpy as np
import pytest

from rulec.mismatch.evidence.steady.rows import inverses

SIZE = 12
"""Outputs of a rig with seven modules."""


def test_units_do_not_make_a_system_singular() -> None:
    """Slopes by pressures (Pa) and powers (W), 1e-10 and 1e-6 m3/s of each, side by side."""
    draw = np.random.default_rng(2)
    units = np.where(np.arange(SIZE) % 2, 1e-10, 1e-6)
    plain = np.eye(SIZE) + 0.1 * draw.standard_normal((5, SIZE, SIZE))
    truth = draw.standard_normal((5, SIZE, 1)) / units[:, None]
    solution = inverses(plain * units) @ (plain * units @ truth)
    assert solution == pytest.approx(truth, rel=1e-9)


def test_singular_systems_have_no_solution() -> None:
    """Two equal columns, and a slope that is no number; the others are solved."""
    matrices = np.array([[[1.0, 1.0], [2.0, 2.0]], [[np.nan, 0.0], [0.0, 1.0]], np.eye(2)])
    solution = inverses(matrices) @ np.ones((3, 2, 1))
    assert np.isnan(solution[:2]).all()
    assert [1.0, 1.0] == solution[2].ravel().tolist()
