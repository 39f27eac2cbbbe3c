"""The integrator: values against LSODA, derivatives, limits."""

import functools
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import rulec_runtime.simulation.integrator as machine
from rulec_runtime.contract.plan import OPERATIONS, UNARY, Array, Plan
from rulec_runtime.contract.ruleset import Dynamics
from rulec_runtime.simulation.balances import Balances, Course

from rulec.passes.pipeline import compile_plant
from tests.conftest import compiled
from tests.states.plants import FEED, SHIPPED, STORE, plant_in, random_inputs, two_tanks

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


def test_limits_hold(tmp_path: Path) -> None:
    """A tank that runs empty is never below its lower limit; a store with a wall keeps what it
    can, and at the wall its level follows the wall alone. No number is lost there, derivatives
    included."""
    time = 4.0 * np.arange(150)
    u = np.where((time > 100) & (time < 400), 0.0, 3.0)
    course = run(time, u, values_of(SHIPPED), "upper.a", "pump.k", "upper.h0")
    assert np.isfinite(course.slopes).all()
    assert 0.0 <= course.states.min() < 1e-6
    levels = course.states[:, 0]
    assert levels[(time > 300) & (time < 400)].max() < 1e-6
    assert levels[-1] > 0.1
    np.testing.assert_allclose(lower(course), two_tanks(time, u), rtol=0, atol=1e-3)
    modules = {"P": "feed", "T": "store"}
    store = compile_plant(plant_in(tmp_path, modules, "P -> T", feed=FEED, store=STORE)).dynamics
    assert store is not None
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


BY_HAND = ("pump.k", "upper.A", "upper.a", "lower.A", "lower.a", "upper.h0", "lower.h0")
"""Seeds of `tests/bench/peers/solvers.py`."""
