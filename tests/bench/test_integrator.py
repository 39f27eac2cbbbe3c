"""Integrating: two tanks over a recording of 1024 samples, beside a solver and a plain loop."""

from __future__ import annotations

import statistics
import time as clock
from collections.abc import Callable

import numpy as np
import pytest
import rulec_runtime.simulation.kernel as kernel
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import Balances

from tests.bench.arithmetic import least, measured
from tests.bench.conftest import Results
from tests.states.plants import SHIPPED, random_inputs, two_tanks
from tests.states.test_integrator import SEEDS, lower, run, tanks, values_of

SAMPLES = 1024


def seconds(call: Callable[[], object], rounds: int) -> float:
    """Median wall time."""
    times = []
    for _ in range(rounds):
        begin = clock.perf_counter()
        call()
        times.append(clock.perf_counter() - begin)
    return statistics.median(times)


def plain_loop(time: Array, u: Array) -> Array:
    """Runge-Kutta of fourth order by hand, one step a sample; V."""
    k, area, gain = SHIPPED["k"], SHIPPED["A"], SHIPPED["gain"]
    out = SHIPPED["a"] * (2.0 * SHIPPED["gravity"]) ** 0.5
    shown = np.empty(len(time))

    def rates(a: float, b: float, now: float) -> tuple[float, float]:
        first, second = out * max(a, 0.0) ** 0.5, out * max(b, 0.0) ** 0.5
        return (k * now - first) / area, (first - second) / area

    a = b = SHIPPED["h0"]
    for i, now in enumerate(u.tolist()):
        shown[i] = gain * b
        if i + 1 < len(time):
            h = float(time[i + 1] - time[i])
            a1, b1 = rates(a, b, now)
            a2, b2 = rates(a + h / 2 * a1, b + h / 2 * b1, now)
            a3, b3 = rates(a + h / 2 * a2, b + h / 2 * b2, now)
            a4, b4 = rates(a + h * a3, b + h * b3, now)
            a = max(a + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), 0.0)
            b = max(b + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4), 0.0)
    return shown


def test_two_tanks(results: Results) -> None:
    """The same course three times; loosely, the machine may be shared."""
    time, u = random_inputs(SAMPLES)
    values = values_of(SHIPPED)
    expected = two_tanks(time, u)
    np.testing.assert_allclose(lower(run(time, u, values)), expected, rtol=0, atol=1e-5)
    np.testing.assert_allclose(plain_loop(time, u), expected, rtol=0, atol=1e-3)
    run(time, u, values, *SEEDS)
    ours = seconds(lambda: run(time, u, values), 30)
    rich = seconds(lambda: run(time, u, values, *SEEDS), 30)
    peer = seconds(lambda: two_tanks(time, u, rtol=1e-6), 3)
    loop = seconds(lambda: plain_loop(time, u), 5)
    results.add(f"integrate two tanks, {SAMPLES} samples", 1e3 * ours, "ms", 2.0)
    results.add(f"    with derivatives by {len(SEEDS)} parameters", 1e3 * rich, "ms", 5.0)
    results.add("    solve_ivp (LSODA, 1e-6) from sample to sample, times ours", peer / ours, "")
    results.add("    Runge-Kutta as a plain Python loop, times ours", loop / ours, "")
    assert peer > 20.0 * ours
    assert loop > ours


@pytest.mark.parametrize("seeds", [(), SEEDS], ids=["plain", "with slopes"])
def test_steps(results: Results, monkeypatch: pytest.MonkeyPatch, seeds: tuple[str, ...]) -> None:
    """A step by the interpreter, by machine code, and at the bound of this machine."""
    pytest.importorskip("numba", reason="machine code is made by numba's LLVM")
    (time, u), values, held = random_inputs(SAMPLES), values_of(SHIPPED), np.array([True])
    found, courses = [], []
    for worth in (np.inf, 0):
        monkeypatch.setattr(kernel, "KERNEL_WORTH", worth)
        plain = tanks()[1]
        balances = Balances(plain.plan, plain.states, plain.inputs, plain.outputs)
        begin = clock.process_time()
        course = balances.run(time, u[:, None], held, values, seeds)
        first = clock.process_time() - begin
        times = []
        for _ in range(15):
            begin = clock.process_time()
            balances.run(time, u[:, None], held, values, seeds)
            times.append(clock.process_time() - begin)
        found.append((min(times) / course.steps, first - min(times)))
        courses.append(course)
    (slow, _), (fast, made) = found
    np.testing.assert_array_equal(courses[0].shown, courses[1].shown)
    np.testing.assert_array_equal(courses[0].slopes, courses[1].slopes)
    bound = least(balances._tape[0], len(seeds), measured())
    results.add(f"step of two tanks, {len(seeds)} slopes: machine code", 1e-6 / fast, "M/s")
    results.add("    interpreter, times machine code", slow / fast, "")
    results.add("    machine code, times the bound of arithmetic", fast / bound, "")
    results.add("    to make it, in steps that it saves", made / (slow - fast), "")
    assert fast < slow
