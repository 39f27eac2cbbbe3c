"""Peers on a table whose residual is known: the learners predict it, the sparse ones name it."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

pytest.importorskip("sklearn")
pytest.importorskip("pysindy")

from tests.rig.peers import learnt, limits
from tests.rig.peers.learnt import Array, Course, discovered, one_thread, regions, rms, stlsq

N, NOISE = 300, 0.02
RNG = np.random.default_rng(1)
X = RNG.uniform(-1.0, 1.0, (N, 2))
TRUTH = 1.0 + X[:, 0] ** 2 - 0.5 * X[:, 1]
HELDOUT = np.arange(N) >= 2 * N // 3


def course(residual: Array) -> Course:
    """A reading that is the residual alone, known in training."""
    measured = np.where(HELDOUT, np.nan, residual + NOISE * RNG.standard_normal(N))
    return Course("m.y", np.arange(N, dtype=float), HELDOUT, measured, np.zeros(N))


@pytest.mark.parametrize(
    "peer",
    [
        learnt.gaussian_process,
        pytest.param(learnt.neural, marks=pytest.mark.prove),
        learnt.sparse,
    ],
)
def test_learners_recover_a_quadratic(
    peer: Callable[[Mapping[str, Array], Course], Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On rows that were not learnt from, a tenth of the residual is left at most."""
    monkeypatch.setattr(limits, "MEMBERS", 2)  # seconds less
    with one_thread():
        found = peer({"a": X[:, 0], "b": X[:, 1]}, course(TRUTH))
    assert rms((found - TRUTH)[HELDOUT]) < 0.1 * rms(TRUTH[HELDOUT])


def test_the_catalogue_names_one_of_three() -> None:
    """The column that is there, with its weight."""
    table = np.stack([X[:, 0], X[:, 0] ** 2, X[:, 1]], axis=1)
    given = course(3.0 * table[:, 1])
    rows = given.learnt
    weights = stlsq(table[rows], given.residual[rows], given.folds[rows])
    assert [1] == list(np.flatnonzero(weights))
    assert weights[1] == pytest.approx(3.0, abs=0.05)


def test_lisdd_names_it_where_it_is() -> None:
    """A term that is missing in half of the space is found there, and nowhere else."""
    table = np.stack([X[:, 0], X[:, 0] ** 2, X[:, 1]], axis=1)
    there = X[:, 0] > np.median(X[:, 0])
    residual = np.where(there, table[:, 1], 0.0) + NOISE * RNG.standard_normal(N)
    region = regions(X, np.ones(N, dtype=bool))
    found = discovered(table, residual, region)
    assert {d.column for d in found} == {1}
    assert all(there[region == d.region].mean() > 0.9 for d in found)
