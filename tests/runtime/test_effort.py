"""What diagnosing a recording costs, counted and not timed: machines differ, counts do not."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.redundancy import residual_basis

from tests.conftest import compiled
from tests.rig.follower.plants import Planted, recorded


def test_no_covariance_is_inverted_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of stacked stretches are the dearest part where faults come and go: as measured, and
    with the errors that a fault leaves, each is worked out once."""
    rules, random = compiled("abc"), np.random.default_rng(1)
    faults = [f.id for f in rules.faults if not f.in_sensor and f.lowest <= 0.3]
    firsts = range(100, 600, 26)
    planted = [Planted(faults[k % len(faults)], 0.3, a, a + 13) for k, a in enumerate(firsts)]
    recording = recorded(rules, 640, planted, 1.0, random)
    alone = len(residual_basis(rules, np.ones(len(rules.observers), dtype=bool)))
    inverted: Counter[bytes] = Counter()
    inv = np.linalg.inv

    def counted(matrices: np.ndarray) -> np.ndarray:
        if len(matrices[0]) > alone:
            inverted.update(one.tobytes() for one in matrices)
        return inv(matrices)

    monkeypatch.setattr(np.linalg, "inv", counted)
    # Courses invert small matrices of their own.
    monkeypatch.setattr(limits, "POINTS_THAT_GROW", 10**6)
    assert len(diagnose(recording, rules).findings) > 0.9 * len(planted)
    assert len(inverted) > len(planted)
    assert max(inverted.values()) == 1
