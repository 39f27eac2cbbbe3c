"""Beside sympy's lambdify: the plan of a plant, all residuals and degrees with uncertainties."""

from __future__ import annotations

import numpy as np

from tests.bench.row import Row, median
from tests.bench.test_plan import block, by_lambdify, in_blocks, readings
from tests.conftest import compiled

SAMPLES, CHUNK = 200_000, 8192
KINDS = ("R:", "u:", "x:linear:", "ux:linear:")


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
