"""Explanations that show the same: also those that no reading shows."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rulec.mismatch.search.scan import coincide

HERE, THERE = np.array([1.0, 2.0, 3.0]), np.array([1.0, 0.0, -1.0])
NOTHING = np.zeros(3)


@dataclass
class Fitted:
    """A model with a single amplitude."""

    raw: Any
    noise: float = 1.0
    prior: Any = field(default_factory=lambda: SimpleNamespace(names=("a",)))

    def __post_init__(self) -> None:
        self.raw = self.table = self.raw[:, None]
        self.weights, self.precision = np.ones(3), np.eye(1)


@pytest.mark.parametrize(
    ("own", "other", "same"),
    [
        (HERE, 2.0 * HERE, True),
        (HERE, THERE, False),
        (HERE, NOTHING, False),
        (NOTHING, HERE, False),
        (NOTHING, NOTHING, True),
    ],
)
def test_explanations_coincide(own: Any, other: Any, same: bool) -> None:
    evidence: Any = SimpleNamespace(whitened=lambda rows, noise: rows)
    law: Any = SimpleNamespace(unknowns=[SimpleNamespace(id="a", null=0.0)])
    models: Any = Fitted(own), Fitted(other)
    assert coincide(evidence, models[0], law, models[1], law) is same
