"""Plans on many samples: by numpy, and by machine code."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from rulec_runtime import limits
from rulec_runtime.contract import plan_kernel
from rulec_runtime.contract.plan import CHUNK, Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.machine_code import engine

from tests.bench.conftest import Results
from tests.conftest import SOURCES, compiled

BLOCK = 16_384
PATHS = {**os.environ, "PYTHONPATH": SOURCES}


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


def nanoseconds(seconds: float, samples: int, ruleset: Ruleset) -> float:
    return 1e9 * seconds / samples / len(ruleset.residuals)


KINDS = {
    "without uncertainty": ("R:",),
    "with uncertainty": ("q:", "guard:", "R:", "u:"),
    "with degrees of all rules": ("R:", "u:", "x:", "ux:"),
}
LONG = 300_000


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("plant", ["abc", "mixing-rig"])
def test_machine_code(
    plant: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, results: Results
) -> None:
    """A long recording into arrays that are there; beside it numpy, and a copy of the same bytes.

    The copy reads every input once and writes every output once: less is not possible. What making
    code costs is told as samples that numpy does in the same time, which `limits` compares.
    """
    pytest.importorskip("numba", reason="machine code is made by numba's LLVM")
    monkeypatch.setenv("RULEC_CACHE", str(tmp_path))
    rules = compiled(plant)
    names = [n for n in rules.plan.outputs if n.startswith(KINDS[kind])]

    def anew() -> Plan:
        part = rules.plan.select(names)
        return Plan(part.inputs, part.constants, part.operations, part.outputs)

    n = LONG if len(names) < 500 else LONG // 4
    by_numpy, first, again = anew(), anew(), anew()
    inputs = readings(rules, by_numpy, n)
    varying = [v for v in inputs.values() if isinstance(v, np.ndarray)]
    out = {name: np.empty(n) for name in names}
    few = block(inputs, 0, 8)

    def copied() -> None:
        for i, values in enumerate(out.values()):
            np.copyto(values, varying[i % len(varying)])

    monkeypatch.setattr(limits, "KEPT_CODE_WORTH", math.inf)
    slow = processor(lambda: by_numpy.run(inputs, out))
    expected = {name: values.copy() for name, values in out.items()}
    call = processor(lambda: by_numpy.run(few), 9)
    for worth in ("KEPT_CODE_WORTH", "PLAN_CODE_WORTH"):
        monkeypatch.setattr(limits, worth, 0)
    engine.object_of("")  # LLVM itself is loaded once, for all plans
    made = processor(lambda: first.run(few), 1)
    plan_kernel._IN_USE.clear()
    loaded = processor(lambda: again.run(few), 1)
    fast = processor(lambda: first.run(inputs, out))
    for name, values in out.items():
        np.testing.assert_array_equal(values, expected[name], name)
    bound, quick = processor(copied), processor(lambda: first.run(few), 9)
    what = f"{plant} {kind}, {len(by_numpy.operations)} operations"
    results.add(f"{what}: numpy", nanoseconds(slow, n, rules), "ns")
    results.add("    machine code", nanoseconds(fast, n, rules), "ns")
    results.add("    a copy of the same bytes", nanoseconds(bound, n, rules), "ns")
    results.add("    machine code, times numpy", fast / slow, "")
    results.add("    machine code, times the copy", fast / bound, "", 3.0)
    results.add("    8 samples, times numpy", quick / call, "")
    results.add("    an operation of numpy: one call, in samples", n * call / slow, "")
    results.add("    making code, in samples for numpy", n * made / slow, "")
    results.add("    loading it, of making it", loaded / made, "")


def test_loading_llvm(results: Results) -> None:
    """What the first plan of a process pays for machine code, in operations times samples."""
    pytest.importorskip("numba", reason="machine code is made by numba's LLVM")
    program = (
        "import time, rulec_runtime.contract.plan, rulec_runtime.machine_code.engine as engine\n"
        "begin = time.process_time()\n"
        "engine.made_for(), engine.loaded(engine.object_of(''), ())\n"
        "print(time.process_time() - begin)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=PATHS
    )
    a, b = np.ones((2, CHUNK))
    plan = Plan(("a", "b"), (), tuple(("mul", 0, i + 1) for i in range(100)), {"y": 101})
    each = processor(lambda: plan.run({"a": a, "b": b}), 9) / CHUNK / 100
    results.add("loading LLVM", 1e3 * float(done.stdout), "ms")
    results.add("    in operations of numpy times samples", float(done.stdout) / each, "")


def processor(call: Callable[[], object], rounds: int = 3) -> float:
    """Least seconds of processor time: others that use the cache only make it longer."""
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return min(times)


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
