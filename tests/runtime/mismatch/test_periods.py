"""Courses of a degree: cut into levels, states told from drift, few degrees."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import InitialCandidate, columns_of
from rulec.mismatch.search.limits import ODD, STEP_PENALTY
from rulec.mismatch.search.periods import degree_course, in_periods
from rulec.mismatch.search.segments import apart, cut, few_levels
from tests.runtime.mismatch.made import opened, recorded, rows_at, tour
from tests.runtime.mismatch.warm import joined

N = 400


def course(*levels: tuple[int, float], seed: int = 1) -> Array:
    """Levels one behind the other, each (means, size in units of noise), with unit noise."""
    noise = np.random.default_rng(seed).standard_normal(sum(n for n, _ in levels))
    return np.concatenate([np.full(n, level) for n, level in levels]) + noise


def states(values: Array, odd: float = 0.0) -> list[tuple[int, int]]:
    """First and last mean (excluded) of what is apart."""
    segments = cut(values, STEP_PENALTY * float(np.log(len(values))))
    on = apart(segments, odd)
    flags = np.zeros(len(values), dtype=bool)
    for first, length in zip(segments.first[on], segments.length[on], strict=True):
        flags[first : first + length] = True
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_one_level(seed: int) -> None:
    """A step must pay for itself."""
    values = course((N, 0.0), seed=seed)
    assert [0] == cut(values, STEP_PENALTY * float(np.log(N))).first.tolist()
    assert [] == states(values)


@pytest.mark.parametrize("size", [6.0, 30.0, 1000.0, -30.0])
def test_a_period_is_found_at_its_ends(size: float) -> None:
    """One period, of either sign, to a mean."""
    ((first, last),) = states(course((150, 0.0), (60, size), (190, 0.0)))
    assert abs(first - 150) <= 1
    assert abs(last - 210) <= 1


@pytest.mark.parametrize("seed", range(5))
def test_several_degrees_are_all_apart(seed: int) -> None:
    """Three periods of three degrees between times at rest."""
    values = course(
        (50, 0.0), (40, 20.0), (60, 0.0), (40, 40.0), (60, 0.0), (50, 60.0), (100, 0.0), seed=seed
    )
    found = states(values)
    assert [(50, 90), (150, 190), (250, 300)] == [(a, b) for a, b in found]


@pytest.mark.parametrize("shape", ["ramp", "bump", "waves", "exponential"])
@pytest.mark.parametrize("odd", ODD)
def test_drift_is_no_fault(shape: str, odd: float) -> None:
    """What changes slowly has no states, however large it is."""
    phase = np.linspace(0.0, 1.0, N)
    drift = {
        "ramp": phase,
        "bump": np.sin(np.pi * phase) ** 2,
        "waves": np.sin(6 * np.pi * phase),
        "exponential": 1.0 - np.exp(-5.0 * phase),
    }[shape]
    assert [] == states(50.0 * drift + course((N, 0.0)), odd)


def test_odd_levels_are_no_state() -> None:
    """A short time far out on the other side counts as a state only if nothing is allowed for."""
    values = course((100, 0.0), (6, -400.0), (100, 0.0), (80, 15.0), (100, 0.0))
    assert [(100, 106), (206, 286)] == states(values, 0.0)
    assert [(206, 286)] == states(values, 0.02)


@pytest.mark.parametrize("seed", range(5))
def test_the_cut_is_optimal(seed: int) -> None:
    """Against all cuts of a short course into up to four levels."""
    draw = np.random.default_rng(seed)
    values = np.repeat(draw.normal(0, 5, 4), 5) + draw.standard_normal(20)

    def cost(edges: list[int]) -> float:
        parts = np.split(values, edges)
        return sum(float(np.sum((p - p.mean()) ** 2)) for p in parts) + 6.0 * len(edges)

    options = [[]] + [[i] for i in range(1, 20)]
    options += [[i, j] for i in range(1, 19) for j in range(i + 1, 20)]
    options += [[i, j, k] for i in range(1, 18) for j in range(i + 1, 19) for k in range(j + 1, 20)]
    best = min(map(cost, options))
    assert cost(cut(values, 6.0).first[1:].tolist()) <= best + 1e-9


@pytest.mark.parametrize(
    ("levels", "number"),
    [
        ([0.2], [0]),
        ([0.2, 0.2, 0.2], [0, 0, 0]),
        ([0.2, 0.41, 0.19, 0.4], [0, 1, 0, 1]),
        ([0.6, 0.2, 0.4], [2, 0, 1]),
        ([0.2, 0.21, 0.4, 0.41, 0.6, 0.59], [0, 0, 1, 1, 2, 2]),
    ],
)
def test_degrees_are_few(levels: list[float], number: list[int]) -> None:
    """Equal ones share a level, at most three are told apart; centres are weighted means."""
    found, centres = few_levels(np.array(levels), np.full(len(levels), 5))
    assert number == found.tolist()
    for i, centre in enumerate(centres):
        mean = np.mean([v for v, k in zip(levels, number, strict=True) if k == i])
        assert float(mean) == pytest.approx(float(centre))


DEGREES = ((40, 80, 0.2), (130, 160, 0.4), (200, 230, 0.2))


@functools.cache
def plain(*degrees: tuple[int, int, float]) -> Fitted:
    """The plain model refitted to a recording with a fault of A that comes and goes."""
    rules, _ = opened("abc")
    degree = np.zeros(300)
    for since, until, x in degrees:
        degree[since:until] = x
    recording = recorded(opened("abc"), tour(rules, 300), {"A.leakage": {"x": degree}})
    rows = rows_at(opened("abc"), recording)
    return fit(rows, Configuration(), rows.system.data.open)


def trial(name: str, *degrees: tuple[int, int, float]) -> InitialCandidate | None:
    """The fault looked for as one that comes and goes."""
    candidates = opened("abc")[1].candidates
    return in_periods(plain(*degrees), next(c for c in candidates if c.id == name))


def test_a_fault_comes_with_its_periods() -> None:
    """Ends to a settled point, two levels; degrees, once refitted, to a hundredth."""
    found = trial("A.leakage", *DEGREES)
    assert found is not None
    assert found.course is not None
    assert 2 == found.course.levels
    values = joined(plain(*DEGREES), found).setting.values
    told = [(p.since, p.until, values[f"A.leakage.x#{p.level}"]) for p in found.course.periods]
    assert len(DEGREES) == len(told)
    for (since, until, x), (begin, end, degree) in zip(DEGREES, told, strict=True):
        assert since <= begin < since + 15
        assert until - 15 < end <= until
        assert x == pytest.approx(degree, abs=0.01)


@pytest.mark.parametrize("x", [0.02, 0.1, 0.6])
def test_small_and_large_faults_are_seen(x: float) -> None:
    """Points with a strong fault are far out, and still speak of it."""
    found = trial("A.leakage", (100, 160, x))
    assert found is not None
    assert found.course is not None
    (period,) = found.course.periods
    assert 100 <= period.since < 115
    assert 145 < period.until < 161


def test_points_that_do_not_speak_of_a_fault_have_no_degree() -> None:
    """Where a module moves, only rounding is left of its slopes: that is no degree, however many
    such points there are."""
    fitted = plain(*DEGREES)
    candidate = next(c for c in opened("abc")[1].candidates if c.id == "A.leakage")
    columns = columns_of(fitted, candidate, {"A.leakage.x": 0.0}, {})
    assert columns is not None
    mute = fitted.rows.point % 3 > 0
    degree, _ = degree_course(fitted, np.where(mute, 1e-14 * columns[:, 0], columns[:, 0]))
    known = np.flatnonzero(np.isfinite(degree))
    assert len(known) > 50
    assert set(known) <= set(fitted.rows.point[~mute])
    assert np.abs(degree[known]).max() < 1.0


def test_without_fault_there_is_no_period() -> None:
    """The degree of a healthy plant is one level."""
    assert trial("A.leakage") is None
