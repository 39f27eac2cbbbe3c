"""Exact derivatives of plans: against finite differences, the compiler's own, and in corners."""

import numpy as np
import pytest
import sympy
from rulec_runtime.contract.plan import UNARY, Plan

from rulec.algebra.derivative import derivative
from rulec.algebra.tangent import run_with_slopes
from rulec.language.functions import FUNCTIONS, Function
from tests.conftest import compiled

PLANTS = ("abc", "esp-pump", "zema-hydraulic")
BINARY = ("add", "sub", "mul", "div", "pow", "min", "max")


@pytest.mark.parametrize("plant", PLANTS)
def test_slopes_are_those_that_the_compiler_derived(plant: str) -> None:
    rules, draw = compiled(plant), np.random.default_rng(4)
    at = {s.id: s.reference * (1.0 + 0.02 * draw.uniform(-1, 1, 5)) for s in rules.signals}
    at |= {name: np.ones(5) for name in rules.plan.inputs if name.startswith("u:")}
    derived = rules.plan.run(at)
    seeds = [s.id for s in rules.signals]
    for observer in rules.observers:
        key = f"q:{observer.id}"
        _, slopes = run_with_slopes(rules.plan.select([key]), at, seeds)
        expected = {s for s in seeds if f"s:{observer.id}:{s}" in rules.plan.outputs}
        assert expected == set(slopes[key])
        for name, slope in slopes[key].items():
            expected_slope = derived[f"s:{observer.id}:{name}"]
            assert expected_slope == pytest.approx(np.broadcast_to(slope, 5), rel=1e-9)


def one(name: str) -> Plan:
    return Plan(("x", "y"), (), ((name, 0, 0 if name in UNARY else 1),), {"out": 2})


@pytest.mark.parametrize("name", [*sorted(UNARY), *BINARY])
def test_every_operation(name: str) -> None:
    plan = one(name)
    for x, y in ((0.7, 1.9), (1.9, 0.7)):
        _, slopes = run_with_slopes(plan, {"x": x, "y": y}, ("x", "y"))
        for seed in plan.used_inputs:
            at = {"x": x, "y": y}
            up, down = (
                float(plan.run({**at, seed: at[seed] + h})["out"][0]) for h in (1e-6, -1e-6)
            )
            expected = (up - down) / 2e-6
            assert expected == pytest.approx(float(slopes["out"].get(seed, 0.0)), abs=1e-8)


@pytest.mark.parametrize(
    ("name", "x", "y", "by_x", "by_y"),
    [
        ("abs", 0.0, 0.0, 0.0, None),
        ("sign", 0.0, 0.0, 0.0, None),
        ("sign", -2.0, 0.0, 0.0, None),
        ("min", 1.0, 1.0, 0.5, 0.5),
        ("max", 1.0, 1.0, 0.5, 0.5),
        ("sqrt", 0.0, 0.0, np.inf, None),
        ("pow", 0.0, 2.0, 0.0, np.nan),
    ],
)
def test_corners(name: str, x: float, y: float, by_x: float, by_y: float | None) -> None:
    """Where a slope jumps, the convention of the compiler holds; where there is none, no number."""
    _, slopes = run_with_slopes(one(name), {"x": x, "y": y}, ("x", "y"))
    found = slopes["out"]
    assert by_x == pytest.approx(float(found["x"]), nan_ok=True)
    assert (by_y is None) == ("y" not in found)
    if by_y is not None:
        assert by_y == pytest.approx(float(found["y"]), nan_ok=True)


def test_what_has_a_slope() -> None:
    """(-2)**2 has the slope -4: only a searched exponent needs a positive base."""
    _, slopes = run_with_slopes(one("pow"), {"x": -2.0, "y": 2.0}, ("x",))
    assert {"x": -4.0} == {k: float(v) for k, v in slopes["out"].items()}
    plan = Plan(("x", "y"), (3.0,), (("mul", 0, 2),), {"three x": 3, "y": 1})
    values, slopes = run_with_slopes(plan, {"x": 2.0, "y": 5.0}, ("x", "y", "z"))
    assert {"three x": 6.0, "y": 5.0} == {k: float(v) for k, v in values.items()}
    assert {"x": 3.0} == {k: float(v) for k, v in slopes["three x"].items()}
    assert {"y": 1.0} == {k: float(v) for k, v in slopes["y"].items()}
    values, _ = run_with_slopes(one("add"), {"x": 1.0}, ("x",))
    assert np.isnan(values["out"])


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_the_compiler_derives_as_sympy_does(function: Function) -> None:
    x, y, z = sympy.symbols("x y z", positive=True)
    inner = function.symbolic(*(x * y**x / (x + 2), x - y)[: function.arity])
    for expression in (inner, x * inner / y - inner**2, inner ** (x / y), y**3 / inner):
        for symbol in (x, y, z):
            first = derivative(expression, symbol)
            assert first == sympy.diff(expression, symbol)
            assert derivative(first, x) == sympy.diff(first, x)
