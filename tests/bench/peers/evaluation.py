"""Beside sympy's lambdify: the plan of a plant, all residuals and degrees with uncertainties."""

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import Ruleset

from tests.bench.row import Row, median
from tests.conftest import compiled

SAMPLES, CHUNK = 200_000, 8192
KINDS = ("R:", "u:", "x:linear:", "ux:linear:")
BLOCK = 16_384


def rows() -> list[Row]:
    """The same outputs from the same inputs, both in blocks that a cache holds."""
    rules = compiled("abc")
    plan = rules.plan.select([n for n in rules.plan.outputs if n.startswith(KINDS)])
    inputs = readings(rules, plan, SAMPLES)
    function = by_lambdify(plan)
    given = {name: inputs[name] for name in plan.inputs}

    def chunks() -> None:
        for low in range(0, SAMPLES, CHUNK):
            function(*block(given, low, low + CHUNK).values())

    expected = plan.run(inputs)
    for name, values in zip(plan.outputs, function(*given.values()), strict=True):
        # Beside a pole of a degree rounding grows without bound: few samples may differ.
        same = np.isclose(values, expected[name], rtol=1e-6, atol=1e-9)
        assert np.mean(same) > 0.999, (name, np.mean(same))
    return [
        Row(
            key="lambdify",
            what=f"{SAMPLES:,} samples through the rules of abc",
            peer="sympy, lambdify with cse, in chunks",
            ours=median(lambda: in_blocks(plan, inputs, SAMPLES)),
            theirs=median(chunks),
            same=f"{len(plan.outputs)} outputs with uncertainties, checked to 1e-6",
            differs="chunks of 8192 there, of 16384 here: each at its best",
        )
    ]


def readings(ruleset: Ruleset, plan: Plan, n: int) -> dict[str, Any]:
    """Readings with noise; standard uncertainties as the sensor classes give them."""
    random = np.random.default_rng(7)
    inputs: dict[str, Any] = {"u:parameters": 1.0, "u:model": 1.0}
    for signal in ruleset.signals:
        if signal.id in plan.inputs:
            inputs[signal.id] = signal.reference * (1 + 0.01 * random.standard_normal(n))
            inputs[f"u:{signal.id}"] = signal.standard * (signal.full_scale or 1.0)
    return inputs


def block(inputs: dict[str, Any], low: int, high: int) -> dict[str, Any]:
    return {k: v[low:high] if isinstance(v, np.ndarray) else v for k, v in inputs.items()}


def in_blocks(plan: Plan, inputs: dict[str, Any], n: int) -> None:
    """Run as a long recording is run: the same output arrays again and again."""
    out = {name: np.empty(BLOCK) for name in plan.outputs}
    for low in range(0, n, BLOCK):
        high = min(low + BLOCK, n)
        plan.run(block(inputs, low, high), {name: v[: high - low] for name, v in out.items()})


def by_lambdify(plan: Plan) -> Callable[..., list[Any]]:
    """The outputs of a plan as sympy would evaluate them."""
    apply: dict[str, Callable[[Any, Any], Any]] = {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
        "neg": lambda a, _: -a,
        "sqrt": lambda a, _: sympy.sqrt(a),
        "abs": lambda a, _: sympy.Abs(a),
    }
    symbols = [sympy.Symbol(f"v{i}", real=True) for i in range(len(plan.inputs))]
    values: list[Any] = [*symbols, *(sympy.Float(c) for c in plan.constants)]
    for name, a, b in plan.operations:
        values.append(apply[name](values[a], values[b]))
    outputs = [values[i] for i in plan.outputs.values()]
    function: Callable[..., list[Any]] = sympy.lambdify(symbols, outputs, "numpy", cse=True)
    return function
