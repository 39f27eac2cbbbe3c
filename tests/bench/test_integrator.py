"""Integrating two tanks over a recording of 1024 samples."""

import numpy as np
import pytest
import rulec_runtime.simulation.kernel as kernel
from rulec_runtime.simulation.balances import Balances

from tests.bench.conftest import Add
from tests.bench.row import least
from tests.states.plants import SHIPPED, random_inputs
from tests.states.test_integrator import SEEDS, tanks, values_of

SAMPLES = 1024


@pytest.mark.parametrize("seeds", [(), SEEDS], ids=["plain", "with slopes"])
def test_steps(add: Add, monkeypatch: pytest.MonkeyPatch, seeds: tuple[str, ...]) -> None:
    """A step by the interpreter and by machine code."""
    pytest.importorskip("numba", reason="machine code is made by numba's LLVM")
    (time, u), values, held = random_inputs(SAMPLES), values_of(SHIPPED), np.array([True])
    found, courses = [], []
    for worth in (np.inf, 0):
        monkeypatch.setattr(kernel, "KERNEL_WORTH", worth)
        plain = tanks()[1]
        balances = Balances(plain.plan, plain.states, plain.inputs, plain.outputs)

        def run(balances: Balances = balances) -> None:
            courses.append(balances.run(time, u[:, None], held, values, seeds))

        first, later = least(run), least(run, 15)
        found.append((later / courses[-1].steps, first - later))
    (slow, _), (fast, made) = found
    np.testing.assert_array_equal(courses[0].shown, courses[-1].shown)
    np.testing.assert_array_equal(courses[0].slopes, courses[-1].slopes)
    add(f"step of two tanks, {len(seeds)} slopes: machine code", 1e-6 / fast, "M/s")
    add("    interpreter, times machine code", slow / fast, "")
    add("    to make it, in steps that it saves", made / (slow - fast), "")
    assert fast < slow
