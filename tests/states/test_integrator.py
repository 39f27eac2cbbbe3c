"""The integrator: values against LSODA, derivatives against differences, limits, operations."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import rulec_runtime.simulation.integrator as machine
from rulec_runtime.contract.plan import OPERATIONS, UNARY, Array, Plan
from rulec_runtime.contract.ruleset import Dynamics
from rulec_runtime.simulation.balances import Balances, Course, RanAway

from rulec.passes.pipeline import compile_plant
from tests.conftest import compiled
from tests.states.plants import (
    FEED,
    SHIPPED,
    STORE,
    plant_in,
    random_inputs,
    recorded,
    two_tanks,
)

LIVELY = {**SHIPPED, "k": 4e-6, "a": 0.1e-4, "h0": 0.08}
"""Tanks that run empty within a few samples."""


@functools.cache
def tanks() -> tuple[Dynamics, Balances]:
    """The two tanks, ready to be integrated."""
    dynamics = compiled("cascaded-tanks").dynamics
    assert dynamics is not None
    return dynamics, balances_of(dynamics)


def balances_of(dynamics: Dynamics) -> Balances:
    states = tuple(s.id for s in dynamics.states)
    shown = tuple(f"shown:{name}" for name in dynamics.outputs)
    return Balances(dynamics.plan, states, dynamics.inputs, shown)


def values_of(by_hand: Mapping[str, float]) -> dict[str, float]:
    """Values written by hand as inputs of the plan; the sensors have no offset."""
    names = {"A": "A", "a": "a", "g": "gain", "h0": "h0", "gravity": "gravity"}
    both = {f"{m}.{n}": by_hand[key] for m in ("upper", "lower") for n, key in names.items()}
    return {"pump.k": by_hand["k"], **both}


def run(time: Array, u: Array, values: Mapping[str, float], *seeds: str) -> Course:
    return tanks()[1].run(time, u[:, None], np.array([True]), values, seeds)


def lower(course: Course) -> Array:
    return course.shown[:, tanks()[1].outputs.index("shown:lower.y")]


@pytest.mark.parametrize(
    ("by_hand", "volts"), [(SHIPPED, 1e-5), (LIVELY, 1e-3)], ids=["shipped", "lively"]
)
@pytest.mark.parametrize("seed", [0, 1])
def test_two_tanks_as_another_solver_has_them(
    by_hand: Mapping[str, float], volts: float, seed: int
) -> None:
    """Random steps of the voltage: LSODA from sample to sample."""
    time, u = random_inputs(seed=seed)
    found = lower(run(time, u, values_of(by_hand)))
    np.testing.assert_allclose(found, two_tanks(time, u, by_hand), rtol=0, atol=volts)


@pytest.mark.parametrize("by_hand", [SHIPPED, LIVELY], ids=["shipped", "lively"])
def test_the_real_inputs(by_hand: Mapping[str, float]) -> None:
    """1024 samples of 4 s, to 1e-5 V; hardly more steps than samples."""
    file = recorded()
    if file is None:
        pytest.skip("no real recordings (set RULEC_RECORDINGS)")
    time, u, _ = np.genfromtxt(file, delimiter=",", skip_header=1).T
    course = run(time, u, values_of(by_hand))
    np.testing.assert_allclose(lower(course), two_tanks(time, u, by_hand), rtol=0, atol=1e-5)
    assert course.steps < (1.5 if by_hand is SHIPPED else 4) * len(time)


def test_shipped_values_are_those_by_hand() -> None:
    """Units on the way from YAML to the plan."""
    expected = values_of(SHIPPED)
    found = {name: v for name, v in tanks()[0].values.items() if v}
    assert expected == pytest.approx(found)


def test_sampling_does_not_matter() -> None:
    """Long steps are cut: every fifth sample of a held input gives the same levels."""
    time, u = 4.0 * np.arange(201), np.repeat(np.array([5.0, 1.0, 3.0, 0.5]), [60, 50, 50, 41])
    fine, coarse = (run(time[::n], u[::n], values_of(SHIPPED)) for n in (1, 5))
    np.testing.assert_allclose(coarse.states, fine.states[::5], rtol=0, atol=1e-5)


def test_a_tank_runs_empty_and_fills_again() -> None:
    """Never below its lower limit, and no number is lost there, derivatives included."""
    time = 4.0 * np.arange(150)
    u = np.where((time > 100) & (time < 400), 0.0, 3.0)
    course = run(time, u, values_of(SHIPPED), "upper.a", "pump.k", "upper.h0")
    assert np.isfinite(course.slopes).all()
    assert 0.0 <= course.states.min() < 1e-6
    levels = course.states[:, 0]
    assert levels[(time > 300) & (time < 400)].max() < 1e-6
    assert levels[-1] > 0.1
    np.testing.assert_allclose(lower(course), two_tanks(time, u), rtol=0, atol=1e-3)


@pytest.fixture
def store(tmp_path: Path) -> Dynamics:
    """A feed and a store with a wall of 10 m."""
    modules = "  P: {type: feed}\n  T: {type: store}\n"
    dynamics = compile_plant(plant_in(tmp_path, modules, "P -> T", feed=FEED, store=STORE)).dynamics
    assert dynamics is not None
    return dynamics


def test_upper_limits_hold(store: Dynamics) -> None:
    """A store with a wall keeps what it can; at the wall its level follows the wall alone."""
    time, u = np.arange(0.0, 200.0, 10.0), np.full((20, 1), 2.0)
    u[12:] = -1.0
    values = {**store.values, "T.top": 0.55}
    course = balances_of(store).run(time, u, np.array([True]), values, ("T.top", "T.h0"))
    rise = np.minimum(0.5 + 1e-3 * time, 0.55)
    fall = 0.55 - 0.5e-3 * np.maximum(time - 120.0, 0.0)
    np.testing.assert_allclose(course.states[:, 0], np.minimum(rise, fall), atol=1e-12)
    at_wall = time >= 60
    np.testing.assert_array_equal(course.slopes[:, 0, 0], np.where(at_wall, 1.0, 0.0))
    np.testing.assert_array_equal(course.slopes[:, 0, 1], np.where(at_wall, 0.0, 1.0))


def test_inputs_held_or_in_lines(store: Dynamics) -> None:
    """Held, a ramp of the input is a stair; in lines its integral is a parabola, exactly."""
    time = np.array([0.0, 1.0, 4.0, 5.0, 9.0])
    u = time[:, None]
    steps = np.concatenate([[0.0], np.cumsum(np.diff(time) * time[:-1])])
    for held, expected in ((True, steps), (False, time**2 / 2.0)):
        course = balances_of(store).run(time, u, np.array([held]), store.values)
        np.testing.assert_allclose(course.states[:, 0], 0.5 + 0.5e-3 * expected, rtol=1e-12)


SEEDS = ("pump.k", "upper.A", "upper.a", "upper.h0", "lower.A", "lower.a", "lower.g", "lower.h0")


@pytest.mark.parametrize("by_hand", [SHIPPED, LIVELY], ids=["shipped", "lively"])
def test_derivatives_are_those_of_differences(by_hand: Mapping[str, float]) -> None:
    """By each parameter, carried along, against central differences of the whole run."""
    time, u = random_inputs(120)
    values = values_of(by_hand)
    slopes = run(time, u, values, *SEEDS).slopes
    for i, name in enumerate(SEEDS):
        step = 1e-5 * values[name]
        above, below = (
            run(time, u, {**values, name: values[name] + side * step}).shown for side in (1, -1)
        )
        expected = (above - below) / (2.0 * step)
        size = np.abs(expected).max()
        np.testing.assert_allclose(slopes[:, :, i], expected, rtol=0, atol=2e-4 * size)


def test_seeds_change_no_value() -> None:
    """With derivatives or without, all of them or one: the same numbers."""
    time, u = random_inputs(60)
    plain, rich = (run(time, u, values_of(LIVELY), *seeds) for seeds in ((), SEEDS))
    np.testing.assert_array_equal(plain.shown, rich.shown)
    alone = run(time, u, values_of(LIVELY), "lower.a")
    np.testing.assert_array_equal(alone.slopes[:, :, 0], rich.slopes[:, :, SEEDS.index("lower.a")])


def test_the_same_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where numba is not installed Python runs the same lines."""
    if not hasattr(machine.integrate, "py_func"):
        pytest.skip("numba is not installed")
    time, u = random_inputs(25)
    fast = run(time, u, values_of(SHIPPED), "upper.a", "lower.h0")
    for name, found in vars(machine).copy().items():
        if hasattr(found, "py_func"):
            monkeypatch.setattr(machine, name, found.py_func)
    slow = run(time, u, values_of(SHIPPED), "upper.a", "lower.h0")
    assert fast.steps == slow.steps
    np.testing.assert_allclose(slow.shown, fast.shown, rtol=1e-13)
    np.testing.assert_allclose(slow.slopes, fast.slopes, rtol=1e-10)


def test_operations_are_those_of_plans() -> None:
    """Each gives what numpy gives, and its derivatives by both operands."""
    names = list(OPERATIONS)
    operations = [(name, 0, 0 if name in UNARY else 1) for name in names]
    plan = Plan(
        ("A.a", "A.b", "A.h"),
        (0.0,),
        tuple(operations),
        {**{name: 4 + i for i, name in enumerate(names)}, "der:A.h": 3, "start:A.h": 3},
    )
    balances = Balances(plan, ("A.h",), (), tuple(names))
    time, inputs, held = np.arange(2.0), np.empty((2, 0)), np.empty(0, dtype=bool)
    for a, b in ((0.7, 0.3), (0.3, 0.7), (1.7, 2.0)):
        values = {"A.a": a, "A.b": b}
        course = balances.run(time, inputs, held, values, ("A.a", "A.b"))
        for i, name in enumerate(names):
            assert course.shown[1, i] == pytest.approx(_by_numpy(name, a, b), rel=1e-14), name
            for j, (da, db) in enumerate(((1e-6, 0.0), (0.0, 1e-6))):
                above, below = (_by_numpy(name, a + s * da, b + s * db) for s in (1, -1))
                slope = (above - below) / 2e-6
                assert course.slopes[1, i, j] == pytest.approx(slope, rel=1e-6, abs=1e-8), name


def _by_numpy(name: str, a: float, b: float) -> float:
    return float(OPERATIONS[name](a) if name in UNARY else OPERATIONS[name](a, b))


def test_what_runs_away_is_told() -> None:
    """A level without bounds is no result."""
    plan = Plan(
        ("A.h", "A.r"), (1.0,), (("mul", 0, 1),), {"der:A.h": 3, "start:A.h": 2, "shown:A.y": 0}
    )
    balances = Balances(plan, ("A.h",), (), ("shown:A.y",))
    time, inputs, held = np.arange(0.0, 1000.0, 10.0), np.empty((100, 0)), np.empty(0, dtype=bool)
    with pytest.raises(RanAway):
        balances.run(time, inputs, held, {"A.r": 1.0})
    course = balances.run(time[:3], inputs[:3], held, {"A.r": 0.1})
    np.testing.assert_allclose(course.shown[:, 0], np.exp([0.0, 1.0, 2.0]), rtol=1e-4)
