"""Courses of a degree: cut into levels, states told from drift, few degrees."""

from __future__ import annotations

import functools
from itertools import combinations

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.screen import InitialCandidate, columns_of
from rulec.mismatch.search.intermittent_fault import Segments, apart, cut, degree_course, in_periods
from rulec.mismatch.search.limits import ODD, STEP_PENALTY
from tests.runtime.mismatch.made import fitted, opened, recorded, tour

N = 400
LEAKAGE = "A.leakage"


def course(*levels: tuple[int, float], seed: int = 1) -> Array:
    """Levels one behind the other, each (means, size in units of noise), with unit noise."""
    noise = np.random.default_rng(seed).standard_normal(sum(n for n, _ in levels))
    return np.concatenate([np.full(n, level) for n, level in levels]) + noise


def states(values: Array, odd: float = 0.0) -> list[tuple[int, int]]:
    """First and last mean (excluded) of what is apart."""
    segments = cut(values, STEP_PENALTY * float(np.log(len(values))))
    on = apart(segments, odd)
    flags = np.zeros(len(values) + 2, dtype=int)
    for first, length in zip(segments.first[on], segments.length[on], strict=True):
        flags[first + 1 : first + length + 1] = 1
    edges = np.flatnonzero(np.diff(flags))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


@pytest.mark.parametrize("seed", range(3))
def test_levels_are_told_from_noise(seed: int) -> None:
    """A step must pay for itself; three periods of three degrees between times at rest do."""
    quiet = course((N, 0.0), seed=seed)
    assert [0] == cut(quiet, STEP_PENALTY * float(np.log(N))).first.tolist()
    assert [] == states(quiet)
    rest = (60, 0.0)
    values = course(rest, (40, 20.0), rest, (40, 40.0), rest, (50, 60.0), (100, 0.0), seed=seed)
    assert [(60, 100), (160, 200), (260, 310)] == states(values)


@pytest.mark.parametrize("odd", ODD)
def test_drift_is_no_fault(odd: float) -> None:
    """What changes slowly has no states, however large it is."""
    phase = np.linspace(0.0, 1.0, N)
    bump, waves = np.sin(np.pi * phase) ** 2, np.sin(6 * np.pi * phase)
    for drift in (phase, bump, waves, 1.0 - np.exp(-5.0 * phase)):
        assert [] == states(50.0 * drift + course((N, 0.0)), odd)


def test_odd_levels_are_no_state() -> None:
    """A short time far out on the other side counts as a state only if nothing is allowed for;
    levels without numbers are one state."""
    values = course((100, 0.0), (6, -400.0), (100, 0.0), (80, 15.0), (100, 0.0))
    assert [(100, 106), (206, 286)] == states(values, 0.0)
    assert [(206, 286)] == states(values, 0.02)
    segments = Segments(np.arange(3), np.array([1.0, np.nan, np.nan]), np.array([9, 9, 9]))
    assert not apart(segments).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_cut_is_optimal(seed: int) -> None:
    """Against all cuts of a short course into up to four levels."""
    draw = np.random.default_rng(seed)
    values = np.repeat(draw.normal(0, 5, 4), 5) + draw.standard_normal(20)

    def cost(edges: tuple[int, ...]) -> float:
        parts = np.split(values, edges)
        return sum(float(np.sum((p - p.mean()) ** 2)) for p in parts) + 6.0 * len(edges)

    best = min(cost(edges) for k in range(4) for edges in combinations(range(1, 20), k))
    assert cost(tuple(cut(values, 6.0).first[1:].tolist())) <= best + 1e-9


@functools.cache
def plain(*degrees: tuple[int, int, float]) -> Fitted:
    """The plain model refitted to a recording with a fault of A that comes and goes."""
    degree = np.zeros(300)
    for since, until, x in degrees:
        degree[since:until] = x
    given = tour(opened("abc")[0], 300)
    return fitted(opened("abc"), recorded(opened("abc"), given, {LEAKAGE: {"x": degree}}))


def trial(*degrees: tuple[int, int, float]) -> InitialCandidate | None:
    """The fault looked for as one that comes and goes."""
    (leakage,) = (c for c in opened("abc")[1].candidates if c.id == LEAKAGE)
    return in_periods(plain(*degrees), leakage)


@pytest.mark.parametrize("x", [0.02, 0.6])
def test_small_and_large_faults_are_seen(x: float) -> None:
    """Points with a strong fault are far out, and still speak of it; the degree of a healthy plant
    is one level."""
    assert trial() is None
    found = trial((100, 160, x))
    assert found is not None
    assert found.course is not None
    (period,) = found.course.periods
    assert 100 <= period.since < 115
    assert 145 < period.until < 161


def test_points_that_do_not_speak_of_a_fault_have_no_degree() -> None:
    """Where a module moves, only rounding is left of its slopes: that is no degree, however many
    such points there are."""
    found = plain((40, 80, 0.2), (130, 160, 0.4), (200, 230, 0.2))
    (leakage,) = (c for c in opened("abc")[1].candidates if c.id == LEAKAGE)
    columns = columns_of(found, leakage, {f"{LEAKAGE}.x": 0.0}, {})
    assert columns is not None
    mute = found.rows.point % 3 > 0
    degree, _ = degree_course(found, np.where(mute, 1e-14 * columns[:, 0], columns[:, 0]))
    known = np.flatnonzero(np.isfinite(degree))
    assert len(known) > 50
    assert set(known) <= set(found.rows.point[~mute])
    assert np.abs(degree[known]).max() < 1.0
