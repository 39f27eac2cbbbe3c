"""Plans on many samples: by numpy, by machine code, and by two other ways."""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from pytest_benchmark.fixture import BenchmarkFixture
from rulec_runtime import limits
from rulec_runtime.contract import plan_kernel
from rulec_runtime.contract.plan import CHUNK, Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.machine_code import engine
from uncertainties import ufloat

from tests.bench.conftest import Results
from tests.conftest import SOURCES, compiled
from tests.runtime.equations import ProgressiveCavity
from tests.runtime.test_uncertainty import Abc, Case, rule, signed_sum

SAMPLES = 1_000_000
BLOCK = 16_384
GOAL = 100.0
FEW = 200
PATHS = {**os.environ, "PYTHONPATH": SOURCES}


@pytest.fixture
def plan(abc: Ruleset) -> Plan:
    """All residuals and linear degrees, with their uncertainties."""
    kinds = ("R:", "u:", "x:linear:", "ux:linear:")
    return abc.plan.select([name for name in abc.plan.outputs if name.startswith(kinds)])


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


def median(call: Callable[[], object], rounds: int = 3) -> float:
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def test_a_million_samples(
    abc: Ruleset, plan: Plan, benchmark: BenchmarkFixture, results: Results
) -> None:
    """Blocks of 16384 samples; memory stays flat."""
    inputs = readings(abc, plan, SAMPLES)
    benchmark.pedantic(in_blocks, (plan, inputs, SAMPLES), rounds=5, warmup_rounds=1)
    seconds = statistics.median(benchmark.stats.stats.data)
    what = f"plan, {len(plan.operations)} operations, {len(plan.outputs)} outputs"
    each = nanoseconds(seconds, SAMPLES, abc)
    results.add(f"{what}: per residual and sample", each, "ns", GOAL)
    results.add(
        "    per operation and sample", 1e9 * seconds / SAMPLES / len(plan.operations), "ns"
    )


def test_ratios(abc: Ruleset, plan: Plan, results: Results) -> None:
    """The same outputs by sympy's lambdify and by `uncertainties`, in the same run."""
    n = 200_000
    inputs = readings(abc, plan, n)
    ours = median(lambda: in_blocks(plan, inputs, n))
    fresh = median(lambda: plan.run(inputs))
    function = by_lambdify(plan)
    given = {name: inputs[name] for name in plan.inputs}
    whole = median(lambda: function(*given.values()))

    def chunked() -> None:
        for low in range(0, n, 8192):
            function(*block(given, low, low + 8192).values())

    parts = median(chunked)
    expected = plan.run(inputs)
    for name, values in zip(plan.outputs, function(*given.values()), strict=True):
        # Beside a pole of a degree rounding grows without bound: few samples may differ.
        same = np.isclose(values, expected[name], rtol=1e-6, atol=1e-9)
        assert np.mean(same) > 0.999, (name, np.mean(same))
    slow = by_uncertainties(abc, inputs) / FEW * n
    results.add("plan in blocks, 2e5 samples", nanoseconds(ours, n, abc), "ns", GOAL)
    for what, seconds in (
        ("plan at once into fresh memory", fresh),
        ("lambdify(cse=True) at once", whole),
        ("lambdify(cse=True) in chunks of 8192", parts),
        ("uncertainties, sample by sample (extrapolated)", slow),
    ):
        results.add(what, nanoseconds(seconds, n, abc), "ns")
        results.add("    times the plan in blocks", seconds / ours, "")


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
    key = f"plan.{plant}.{kind.replace(' ', '-')}.times-copy"
    results.add("    machine code, times the copy", fast / bound, "", 3.0, key)
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


def by_uncertainties(ruleset: Ruleset, inputs: dict[str, Any]) -> float:
    """Seconds for a few samples, equations by hand, all residuals and degrees."""
    kinds = {"A": ProgressiveCavity, "B": ProgressiveCavity}
    at = Case(ruleset, "dosing-pcp", {}, {})
    fixed = {k: ufloat(v, u) if u else v for k, (v, u) in at.parameters().items()}
    names = [s.id for s in ruleset.signals if s.id in inputs]
    residuals = {r.id: r for r in ruleset.residuals}
    begin = time.perf_counter()
    for i in range(FEW):
        read = {name: ufloat(inputs[name][i], inputs[f"u:{name}"]) for name in names}
        system = Abc(kinds, fixed | read)
        observers = system.observers()
        for residual in residuals.values():
            signed_sum(residual, observers).std_dev  # noqa: B018
        for cell in ruleset.cells:
            rule(system, residuals[cell.residual], cell.fault).std_dev  # noqa: B018
    return time.perf_counter() - begin
