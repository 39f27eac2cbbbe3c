"""The interpreter of plans, the graph that makes them, and rulesets as files."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import mpmath
import numpy as np
import pytest
import sympy
import yaml
from hypothesis import assume, given, reject, settings
from rulec_runtime.contract import plan as plan_module
from rulec_runtime.contract.plan import CHUNK, OPERATIONS, UNARY, Plan
from rulec_runtime.contract.ruleset import FORMAT_VERSION, Ruleset
from rulec_runtime.contract.ruleset_file import RulesetRefused, parse_ruleset, read_ruleset

from rulec.algebra.graph import Graph
from rulec.algebra.recipe import lower
from rulec.language.functions import Absolute, Larger, Signum, Smaller
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, SOURCES

NUMPY: Mapping[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "pow": lambda a, b: a**b,
    "min": np.minimum,
    "max": np.maximum,
    "neg": lambda a, _: -a,
    "sqrt": lambda a, _: np.sqrt(a),
    "abs": lambda a, _: np.abs(a),
    "sign": lambda a, _: np.sign(a),
    "exp": lambda a, _: np.exp(a),
    "log": lambda a, _: np.log(a),
    "tanh": lambda a, _: np.tanh(a),
}
A = np.array([0.5, 2.0, 0.0, -1.5, np.nan, np.inf, 3.0])
B = np.array([2.0, 0.5, 0.0, 2.0, 1.0, -1.0, np.nan])


def single(name: str) -> Plan:
    return Plan(("a", "b"), (), ((name, 0, 1),), {"y": 2})


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_is_that_of_numpy(name: str) -> None:
    """Arrays, numbers, and both mixed; bad values give NaN or infinity and no warning."""
    given: tuple[tuple[Any, Any], ...] = ((A, B), (A, 2.0), (2.0, B), (0.7, 2.0), (A, np.nan))
    for a, b in given:
        with np.errstate(all="ignore"):
            expected = np.atleast_1d(np.asarray(NUMPY[name](np.asarray(a), np.asarray(b)) * 1.0))
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
    """Results are those of numpy at once, whatever the length; written into the arrays that are
    given, and no input is changed."""
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


def test_a_real_plan_in_chunks_and_parts(abc: Ruleset, monkeypatch: pytest.MonkeyPatch) -> None:
    inputs, names = readings_of(abc, 40), list(abc.plan.outputs)
    expected = abc.plan.run(inputs)
    random.Random(3).shuffle(names)
    chosen = [names, *([name] for name in names[::20])]
    for chunk, parts in ((CHUNK, chosen), (1, [names]), (7, [names]), (39, [names])):
        monkeypatch.setattr(plan_module, "CHUNK", chunk)
        for part in parts:
            found = abc.plan.select(part).run(inputs)
            assert part == list(found)
            for name in part:
                np.testing.assert_array_equal(expected[name], found[name], err_msg=name)


def readings_of(ruleset: Ruleset, n: int) -> dict[str, Any]:
    generator = np.random.default_rng(5)
    inputs: dict[str, Any] = {"u:parameters": 1.0, "u:model": 1.0}
    for signal in ruleset.signals:
        inputs[signal.id] = signal.reference * (1.0 + 0.1 * generator.standard_normal(n))
        inputs[signal.id][3] = np.nan
        inputs[f"u:{signal.id}"] = 0.01 * abs(signal.reference)
    return inputs


def test_inputs_of_any_kind() -> None:
    """What does not depend on an absent input is there all the same; other numbers are calculated
    in double precision; different lengths are refused."""
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
    """Nothing of a damaged plan is run, and what names what is not there is no KeyError later; the
    message says what to do."""
    text = abc.to_json()
    for number, damage in enumerate(DAMAGES_OF_PLANS if part else DAMAGES):
        data = json.loads(text)
        damage(data[part] if part else data)
        with pytest.raises(RulesetRefused, match="compile again"):
            pytest.fail(f"read with damage {number}: {parse_ruleset(data).plant}")


def test_what_is_no_ruleset_is_refused(abc: Ruleset, tmp_path: Path) -> None:
    """Older and newer formats are named with what to do; any other file gives a message with its
    name, no traceback."""
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
    """Compiled again by another process, from another folder, with another order of sets; what is
    read is equal, and is JSON without NaN."""
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


# --- the graph ------------------------------------------------------------------------------

SYMBOLS = sympy.symbols("a b c", real=True)
NUMBERS = st.sampled_from([-2, -1, 0, 1, 2, 3, sympy.Rational(1, 2), sympy.Rational(-7, 4), 0.3])
POWERS = st.sampled_from(
    [-3, -2, -1, 2, 3, 8, sympy.Rational(1, 2), sympy.Rational(-3, 2), sympy.Rational(7, 4)]
)


def _grown(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Expressions of the language, with arguments kept where the functions exist.

    Numbers have no powers and roots: sympy works them out in full, and factors what has a million
    digits.
    """
    quarter = sympy.Rational(1, 4)
    positive = inner.map(lambda e: (e**2 if e.free_symbols else Absolute(e)) + quarter)
    return st.one_of(
        st.tuples(inner, inner).map(lambda p: p[0] + p[1]),
        st.tuples(inner, inner).map(lambda p: p[0] - p[1]),
        st.tuples(inner, inner).map(lambda p: p[0] * p[1]),
        st.tuples(inner, positive).map(lambda p: p[0] / p[1]),
        st.tuples(positive, POWERS).map(lambda p: p[0] ** p[1] if p[0].free_symbols else p[0]),
        positive.map(lambda e: sympy.sqrt(e) if e.free_symbols else e),
        positive.map(lambda e: sympy.log(e) if e.free_symbols else e),
        inner.map(lambda e: sympy.exp(sympy.tanh(e))),
        inner.map(Absolute),
        inner.map(Signum),
        inner.map(lambda e: -e),
        st.tuples(inner, inner).map(lambda p: Smaller(p[0], p[1])),
        st.tuples(inner, inner).map(lambda p: Larger(p[0], p[1])),
    )


EXPRESSIONS = st.recursive(
    st.one_of(st.sampled_from(SYMBOLS), NUMBERS.map(sympy.sympify)), _grown, max_leaves=10
)
READINGS = st.tuples(*[st.floats(0.2, 3.0) for _ in SYMBOLS])
DIGITS = 40


def lowered(expression: sympy.Expr, at: tuple[float, ...]) -> float:
    graph = Graph(["a", "b", "c"])
    nodes = {symbol: graph.input(symbol.name) for symbol in SYMBOLS}
    graph.outputs["y"] = lower(graph, expression, nodes)
    return float(graph.plan().run(dict(zip("abc", at, strict=True)))["y"][0])


FUNCTIONS = {"Absolute": abs, "Signum": mpmath.sign, "Smaller": min, "Larger": max}


def exact(expression: sympy.Expr, at: tuple[Any, ...]) -> tuple[Any, float]:
    """Value by mpmath in many digits, and the size of its largest part.

    Not by sympy's own evaluation: it reasons about the signs of nested parts, without end.
    """
    parts = list(sympy.preorder_traversal(expression))
    with mpmath.workdps(DIGITS):
        try:
            found = sympy.lambdify(SYMBOLS, parts, [FUNCTIONS, "mpmath"])(*map(mpmath.mpf, at))
        except (ZeroDivisionError, ValueError, OverflowError):
            reject()
        values = [mpmath.mpmathify(value) for value in found]
    assume(all(isinstance(v, mpmath.mpf) and mpmath.isfinite(v) for v in values))
    known = dict(zip(parts, values, strict=True))
    assume(all(abs(known[p.args[0]]) > 1e-9 for p in parts if isinstance(p, Signum)))
    return values[0], max(abs(float(value)) for value in values)


@settings(max_examples=60, deadline=None)
@given(EXPRESSIONS, READINGS)
def test_lowered_expressions_evaluate_like_sympy(expression: sympy.Expr, at: Any) -> None:
    """A random expression as a plan to 1e-12 of its largest part; its derivative can be lowered
    too, and is that of the function, corners left out."""
    value, size = exact(expression, at)
    assume(size < 1e9)
    assert float(value) == pytest.approx(lowered(expression, at), rel=1e-12, abs=1e-12 * size)
    with mpmath.workdps(DIGITS):
        step = mpmath.mpf("1e-12")
        here = [mpmath.mpf(v) for v in at]
        ends = [(here[0] + h, *here[1:]) for h in (step, -step)]
        (above, size), (below, _) = (exact(expression, end) for end in ends)
        expected = float((above - below) / (2 * step))
    found = lowered(sympy.diff(expression, SYMBOLS[0]), at)
    assume(size < 1e6 and abs(expected) < 1e6)
    assume(expected == pytest.approx(found, rel=1e-3) or not _at_a_corner(expression, at))
    assert expected == pytest.approx(found, rel=1e-8, abs=1e-8 * max(size, 1.0))


def _at_a_corner(expression: sympy.Expr, at: tuple[float, ...]) -> bool:
    """Whether an argument of abs is 0, or both of min or max are equal, by chance or always."""
    point = dict(zip(SYMBOLS, at, strict=True))
    arguments = [e.args[0] for e in expression.atoms(Absolute, Signum)]
    arguments += [e.args[0] - e.args[1] for e in expression.atoms(Smaller, Larger)]
    return any(abs(exact(e, tuple(point.values()))[0]) < 1e-9 for e in arguments)


BINARY = [name for name in OPERATIONS if name not in UNARY and name != "pow"]
STEPS = st.lists(
    st.tuples(
        st.sampled_from([*BINARY, "neg", "neg", "abs", "sqrt", "sign"]),
        st.integers(0, 30),
        st.integers(0, 30),
    ),
    min_size=1,
    max_size=25,
)


@settings(max_examples=100, deadline=None)
@given(STEPS, st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_folding_and_signs_keep_values(steps: list[tuple[str, int, int]], at: list[float]) -> None:
    """A graph of random operations, built with and without its shortcuts, gives the same values.

    Constants 0, 1 and -1 and negations stand among the operands, so every shortcut is taken.
    """
    assume(all(abs(v) > 1e-3 for v in at))
    graph = Graph(["a", "b", "c"])
    nodes = [graph.input(name) for name in "abc"]
    nodes += [graph.constant(v) for v in (0.0, 1.0, -1.0, 2.5)]
    plain = [np.float64(v) for v in (*at, 0.0, 1.0, -1.0, 2.5)]
    with np.errstate(all="ignore"):
        for name, i, j in steps:
            i, j = i % len(nodes), j % len(nodes)
            value = np.float64(NUMPY[name](plain[i], plain[j]))
            if not np.isfinite(value) or abs(value) > 1e9:
                continue
            nodes.append(graph.apply(name, nodes[i], 0 if name in UNARY else nodes[j]))
            plain.append(value)
    graph.outputs = {str(i): node for i, node in enumerate(nodes)}
    found = graph.plan().run(dict(zip("abc", at, strict=True)))
    for i, expected in enumerate(plain):
        assert float(expected) == pytest.approx(float(found[str(i)][0]), rel=1e-12, abs=1e-300)
