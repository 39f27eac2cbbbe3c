"""The interpreter of plans, the graph that makes them, exact derivatives, rulesets as files."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy
import yaml
from rulec_runtime.contract.plan import CHUNK, OPERATIONS, UNARY, Plan
from rulec_runtime.contract.ruleset import FORMAT_VERSION, Ruleset
from rulec_runtime.contract.ruleset_file import RulesetRefused, parse_ruleset, read_ruleset

from rulec.algebra.derivative import derivative
from rulec.algebra.graph import Graph
from rulec.algebra.recipe import lower
from rulec.algebra.tangent import run_with_slopes
from rulec.language.functions import FUNCTIONS, Absolute, Function, Larger, Signum, Smaller
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, SOURCES

NUMPY = {
    **{"sub": np.subtract, "mul": np.multiply, "div": np.divide, "pow": np.power},
    **{"min": np.minimum, "max": np.maximum, "neg": np.negative},
}
"""Operations that numpy calls otherwise."""

A = np.array([0.5, 2.0, 0.0, -1.5, np.nan, np.inf, 3.0])
B = np.array([2.0, 0.5, 0.0, 2.0, 1.0, -1.0, np.nan])


def single(name: str) -> Plan:
    return Plan(("a", "b"), (), ((name, 0, 0 if name in UNARY else 1),), {"y": 2})


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_is_that_of_numpy(name: str) -> None:
    """Arrays, numbers, and both mixed; bad values give NaN or infinity and no warning."""
    given: tuple[tuple[Any, Any], ...] = ((A, B), (A, 2.0), (2.0, B), (0.7, 2.0), (A, np.nan))
    function = NUMPY.get(name) or getattr(np, name)
    for a, b in given:
        with np.errstate(all="ignore"):
            expected = np.atleast_1d(function(*map(np.asarray, (a, b)[: function.nin])) * 1.0)
        found = single(name).run({"a": a, "b": b})["y"]
        if name not in UNARY or isinstance(a, np.ndarray):
            np.testing.assert_array_equal(np.broadcast_to(expected, found.shape), found)
        else:
            assert np.all((found == expected) | np.isnan(expected))


def longer() -> Plan:
    """y = sqrt(a*b) - 3, z = y/a + y; some outputs are no operation, one has two names."""
    operations = (("mul", 0, 1), ("sqrt", 4, 0), ("sub", 5, 3), ("div", 6, 0), ("add", 7, 6))
    outputs = {"y": 6, "z": 8, "again": 8, "a": 0, "three": 3, "scalar": 2}
    return Plan(("a", "b", "c"), (3.0,), operations, outputs)


@pytest.mark.parametrize("n", [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK + 7])
def test_chunk_borders_leave_no_trace(n: int) -> None:
    a, b = np.linspace(1.0, 5.0, n), np.linspace(2.0, 3.0, n) ** 2
    out = {name: np.full(n, -1.0) for name in longer().outputs}
    found = longer().run({"a": a, "b": b, "c": 4.0})
    assert all(v is out[k] for k, v in longer().run({"a": a, "b": b, "c": 4.0}, out).items())
    y = np.sqrt(a * b) - 3.0
    expected = {"y": y, "z": y / a + y, "again": y / a + y, "a": a}
    expected |= {"three": np.full(n, 3.0), "scalar": np.full(n, 4.0)}
    for name, values in expected.items():
        np.testing.assert_array_equal(values, found[name])
        np.testing.assert_array_equal(values, out[name])
    found["a"][:] = 0.0
    np.testing.assert_array_equal(np.linspace(1.0, 5.0, n), a)


def readings_of(ruleset: Ruleset, n: int) -> dict[str, Any]:
    generator = np.random.default_rng(5)
    inputs: dict[str, Any] = {"u:parameters": 1.0, "u:model": 1.0}
    for signal in ruleset.signals:
        inputs[signal.id] = signal.reference * (1.0 + 0.1 * generator.standard_normal(n))
        inputs[signal.id][3] = np.nan
        inputs[f"u:{signal.id}"] = 0.01 * abs(signal.reference)
    return inputs


def test_inputs_of_any_kind() -> None:
    plan = Plan(("a", "b"), (), (("add", 0, 0), ("mul", 0, 1)), {"twice": 2, "product": 3})
    found = plan.run({"a": np.array([1.0, 2.0])})
    np.testing.assert_array_equal([2.0, 4.0], found["twice"])
    assert np.isnan(found["product"]).all()
    third = Plan(("a",), (3.0,), (("div", 0, 1),), {"y": 2})
    for a in (np.array([1, 2]), np.array([1, 2], dtype=np.float32), [1, 2]):
        np.testing.assert_array_equal(np.array([1.0, 2.0]) / 3.0, third.run({"a": a})["y"])  # type: ignore[dict-item]
    with pytest.raises(ValueError, match=r"different length: \[2, 3\]"):
        single("add").run({"a": np.zeros(2), "b": np.zeros(3)})


def test_select_keeps_what_is_needed() -> None:
    chosen = longer().select(["y"])
    assert (3, {"y"}) == (len(chosen.operations), set(chosen.outputs))
    assert {"a", "b"} == chosen.used_inputs - {"c"}
    with pytest.raises(KeyError):
        longer().select(["nothing"])


def end_of(plan: dict[str, Any]) -> int:
    return len(plan["inputs"]) + len(plan["constants"]) + len(plan["operations"])


def entered(part: Any, *path: Any) -> None:
    """Put the last of a path in the place that the others lead to."""
    *steps, key, value = path
    for step in steps:
        part = part[step]
    part[key] = value


def name_of_output(plan: dict[str, Any]) -> str:
    return next(iter(plan["outputs"]))


def set_to(*path: Any) -> Callable[[dict[str, Any]], object]:
    return lambda data: entered(data, *path)


DAMAGES_OF_PLANS: tuple[Callable[[dict[str, Any]], object], ...] = (
    set_to("operations", 5, 0, "eval"),
    lambda p: entered(p, "operations", 0, 1, len(p["inputs"]) + len(p["constants"])),
    lambda p: entered(p, "operations", 0, ["add", 0, end_of(p) - 1]),
    set_to("operations", 3, 1, -1),
    lambda p: entered(p, "outputs", name_of_output(p), end_of(p)),
    lambda p: entered(p, "outputs", name_of_output(p), -1),
    set_to("operations", 2, ["neg"]),
    lambda p: p["operations"][2].append(0),
    set_to("operations", 2, 1, "0"),
    set_to("operations", 2, 1, 0.5),
    lambda p: entered(p, "outputs", name_of_output(p), "x"),
    set_to("constants", 0, "os.system"),
    lambda p: p.pop("operations"),
)
"""Operations that are none, or read themselves, what comes later or what is before the first;
outputs that are none; too short, too long, of text or fractions; none at all."""

DAMAGES: tuple[Callable[[dict[str, Any]], object], ...] = (
    set_to("plan", []),
    set_to("undo", None),
    set_to("cells", 0, "fault", "A.nothing"),
    set_to("cells", 0, "residual", "A.nothing"),
    set_to("faults", 0, "affects", ["A.nothing"]),
    set_to("observers", 0, "signals", ["A.nothing"]),
    set_to("observers", 0, "module", "Z"),
    set_to("observers", 2, "guards", [{"output": "guard:no", "text": "x"}]),
    set_to("residuals", 0, "terms", [{"observer": "A.nothing", "sign": 1}]),
    set_to("signals", 0, "kind", "guess"),
    set_to("signals", 1, "id", "A.n"),
    set_to("simulation", "steps", 0, "zeros", 0, "A.x", 1.0),
    set_to("simulation", "steps", 0, "flows", "X", {"A.pump": 1.0}),
    lambda d: d["simulation"]["steps"][0]["zeros"].pop(),
    lambda d: d["simulation"]["steps"].reverse(),
    lambda d: d["simulation"]["steps"].append(d["simulation"]["steps"][0]),
)


@pytest.mark.parametrize("part", ["plan", "undo", ""])
def test_damaged_rulesets_are_refused(abc: Ruleset, part: str) -> None:
    """Nothing of a damaged plan is run; what names what is not there is no KeyError later."""
    text = abc.to_json()
    for number, damage in enumerate(DAMAGES_OF_PLANS if part else DAMAGES):
        data = json.loads(text)
        damage(data[part] if part else data)
        with pytest.raises(RulesetRefused, match="compile again"):
            pytest.fail(f"read with damage {number}: {parse_ruleset(data).plant}")


def test_what_is_no_ruleset_is_refused(abc: Ruleset, tmp_path: Path) -> None:
    for version in (None, 0, FORMAT_VERSION + 1, "1", [1]):
        data = json.loads(abc.to_json()) | {"format_version": version}
        with pytest.raises(RulesetRefused, match=r"format version .* compile the plant again"):
            parse_ruleset(data)
    file = tmp_path / "x.json"
    for content in ("", "[]", "null", "3", "{}", '{"format_version": 1}', "{"):
        file.write_text(content, encoding="utf-8")
        with pytest.raises(RulesetRefused, match=r"x\.json"):
            read_ruleset(file)


def test_round_trip_gives_the_same_bytes(abc: Ruleset, tmp_path: Path) -> None:
    """Compiled by another process, in another folder, with another order of sets."""
    file = tmp_path / "abc.ruleset.json"
    command = [sys.executable, "-m", "rulec", "compile", str(ROOT / "plants" / "abc")]
    environment = {**os.environ, "PYTHONHASHSEED": "1", "PYTHONPATH": SOURCES}
    subprocess.run(
        [*command, "-o", str(file)], cwd=tmp_path, env=environment, check=True, capture_output=True
    )
    assert abc.to_json() == file.read_text(encoding="utf-8")
    again = read_ruleset(file)
    assert (abc, abc.to_json()) == (again, again.to_json())
    json.loads(abc.to_json(), parse_constant=pytest.fail)


def test_order_of_yaml_keys_changes_only_order(abc: Ruleset, tmp_path: Path) -> None:
    data = yaml.safe_load((ROOT / "plants" / "abc" / "plant.yaml").read_text(encoding="utf-8"))
    data["connections"].reverse()
    data["modules"] = dict(reversed(data["modules"].items()))
    shuffled = dict(reversed(data.items())) | {"kb": str(ROOT / "kb")}
    shutil.copy(ROOT / "plants" / "abc" / "calibration.yaml", tmp_path)
    (tmp_path / "plant.yaml").write_text(yaml.safe_dump(shuffled, sort_keys=False))
    other = compile_plant(tmp_path)
    for table in ("signals", "observers", "faults", "parameters"):
        ours, theirs = ({row.id for row in getattr(rules, table)} for rules in (abc, other))
        assert ours == theirs
    for ours, theirs in ((abc.plan, other.plan), (abc.undo, other.undo)):
        inputs = readings_of(abc, 5) | {f"x:{f.id}": 0.1 for f in abc.faults}
        expected, found = ours.run(inputs), theirs.run(inputs)
        assert set(expected) == set(found)
        for name in expected:
            np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, atol=1e-12)


SYMBOLS = sympy.symbols("a b c", real=True)
AT = (1.23, 0.71, 1.77)
POWERS = (-3, -2, -1, 2, 3, 8, *map(sympy.Rational, ("1/2", "-3/2", "7/4")))
GROWN: tuple[Callable[[Any, Any], Any], ...] = (
    *(lambda x, y, power=power: (x**2 + 1) ** power for power in POWERS),
    lambda x, y: x + y,
    lambda x, y: sympy.Rational(-7, 4) * x - y,
    lambda x, y: x * y,
    lambda x, y: x / (y**2 + 0.3),
    lambda x, y: sympy.log(x**2 + 1),
    lambda x, y: sympy.exp(sympy.tanh(x)),
    lambda x, y: Absolute(x - 3),
    lambda x, y: Signum(x - 2),
    lambda x, y: Smaller(x, y),
    lambda x, y: Larger(y, x),
)
EXACT = [{"Absolute": abs, "Signum": mpmath.sign, "Smaller": min, "Larger": max}, "mpmath"]


def lowered(expression: sympy.Expr) -> float:
    graph = Graph(["a", "b", "c"])
    nodes = {symbol: graph.input(symbol.name) for symbol in SYMBOLS}
    graph.outputs["y"] = lower(graph, expression, nodes)
    return float(graph.plan().run(dict(zip("abc", AT, strict=True)))["y"][0])


@pytest.mark.parametrize("outer", GROWN)
def test_lowered_expressions_evaluate_like_sympy(outer: Callable[[Any, Any], Any]) -> None:
    """Expressions in expressions as plans, and their derivatives, by mpmath in many digits."""
    a, b, c = SYMBOLS
    for inner in GROWN:
        expression = outer(inner(a, b), c)
        value = sympy.lambdify(SYMBOLS, expression, EXACT)
        assert float(value(*AT)) == pytest.approx(lowered(expression), rel=1e-12, abs=1e-12)
        with mpmath.workdps(40):
            step = mpmath.mpf("1e-12")
            above, below = (value(AT[0] + h, *map(mpmath.mpf, AT[1:])) for h in (step, -step))
            slope = float((above - below) / (2 * step))
        found = lowered(sympy.diff(expression, a))
        assert slope == pytest.approx(found, rel=1e-8, abs=1e-8), expression


BINARY = ("add", "sub", "mul", "div", "pow", "min", "max")


@pytest.mark.parametrize("name", [*sorted(UNARY), *BINARY, "several"])
def test_every_operation(name: str) -> None:
    """By differences; also where an input acts by several ways."""
    plan = longer() if name == "several" else single(name)
    for a, b in ((0.7, 1.9), (1.9, 0.7)):
        at = {"a": a, "b": b, "c": 1.0}
        _, slopes = run_with_slopes(plan, at, tuple(at))
        for seed in plan.used_inputs:
            up, down = (plan.run({**at, seed: at[seed] + h}) for h in (1e-6, -1e-6))
            for output, by in slopes.items():
                slope = (up[output][0] - down[output][0]) / 2e-6
                assert slope == pytest.approx(float(by.get(seed, 0.0)), abs=1e-8), output


@pytest.mark.parametrize(
    ("name", "a", "b", "by_a", "by_b"),
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
def test_corners(name: str, a: float, b: float, by_a: float, by_b: float | None) -> None:
    """Where a slope jumps, the convention of the compiler holds; where there is none, no number."""
    _, slopes = run_with_slopes(single(name), {"a": a, "b": b}, ("a", "b"))
    expected = {"a": by_a} | ({} if by_b is None else {"b": by_b})
    found = {seed: float(slope) for seed, slope in slopes["y"].items()}
    assert expected == pytest.approx(found, nan_ok=True)


def test_what_has_a_slope() -> None:
    """(-2)**2 has the slope -4: only a searched exponent needs a positive base."""
    _, slopes = run_with_slopes(single("pow"), {"a": -2.0, "b": 2.0}, ("a",))
    assert {"a": -4.0} == slopes["y"]
    plan = Plan(("x", "y"), (3.0,), (("mul", 0, 2),), {"three x": 3, "y": 1})
    values, slopes = run_with_slopes(plan, {"x": 2.0, "y": 5.0}, ("x", "y", "z"))
    assert {"three x": 6.0, "y": 5.0} == values
    assert {"three x": {"x": 3.0}, "y": {"y": 1.0}} == slopes
    values, _ = run_with_slopes(single("add"), {"a": 1.0}, ("a",))
    assert np.isnan(values["y"])


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_the_compiler_derives_as_sympy_does(function: Function) -> None:
    x, y, z = sympy.symbols("x y z", positive=True)
    inner = function.symbolic(*(x * y**x / (x + 2), x - y)[: function.arity])
    for expression in (inner, x * inner / y - inner**2, inner ** (x / y), y**3 / inner):
        for symbol in (x, y, z):
            first = derivative(expression, symbol)
            assert first == sympy.diff(expression, symbol)
            assert derivative(first, x) == sympy.diff(first, x)
