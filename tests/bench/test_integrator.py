"""Integrating two tanks over a recording of 1024 samples."""

from __future__ import annotations

import time as clock

import numpy as np
import pytest
import rulec_runtime.simulation.kernel as kernel
from rulec_runtime.simulation.balances import Balances

from tests.bench.conftest import Results
from tests.states.plants import SHIPPED, random_inputs
from tests.states.test_integrator import SEEDS, tanks, values_of

SAMPLES = 1024


@pytest.mark.parametrize("seeds", [(), SEEDS], ids=["plain", "with slopes"])
def test_steps(results: Results, monkeypatch: pytest.MonkeyPatch, seeds: tuple[str, ...]) -> None:
    """A step by the interpreter and by machine code."""
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
    results.add(f"step of two tanks, {len(seeds)} slopes: machine code", 1e-6 / fast, "M/s")
    results.add("    interpreter, times machine code", slow / fast, "")
    results.add("    to make it, in steps that it saves", made / (slow - fast), "")
    assert fast < slow
