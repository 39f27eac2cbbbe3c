"""What this machine's arithmetic can do at best, measured: the bound of the integrator.

Values of a stage depend on each other: no program takes less than the longest chain of them, each
operation at its latency. Slopes are independent columns: no program takes less than all products
and sums at full throughput. Both may go on at once, so the larger counts.
"""

from __future__ import annotations

import statistics
import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import UNARY
from rulec_runtime.simulation.kernel_code import NAMES
from rulec_runtime.simulation.tape import Tape

ROUNDS = 20_000


@dataclass(frozen=True)
class Arithmetic:
    """Latencies, s, of sum or product, quotient, root; sums and products a second at best."""

    sum: float
    quotient: float
    root: float
    throughput: float

    def latency(self, operation: str) -> float:
        """Of an operation of a tape; what else there is counts as a sum."""
        return {"div": self.quotient, "sqrt": self.root}.get(operation, self.sum)


def measured() -> Arithmetic:
    """Measure; numba compiles four short loops."""
    from numba import njit

    @njit
    def sums(x: float, n: int) -> float:
        for _ in range(n):
            x = x * 0.999 + 0.001
        return x

    @njit(error_model="numpy")
    def quotients(x: float, n: int) -> float:
        for _ in range(n):
            x = 1.5 / x
        return x

    @njit
    def roots(x: float, n: int) -> float:
        for _ in range(n):
            x = np.sqrt(x)
        return x

    @njit
    def columns(y: Any, n: int) -> None:
        for _ in range(n):
            for i in range(64):
                y[i] = y[i] * 0.999 + 0.001

    y = np.ones(64)
    return Arithmetic(
        sum=_seconds(lambda: sums(1.5, ROUNDS)) / (2 * ROUNDS),
        quotient=_seconds(lambda: quotients(1.2, ROUNDS)) / ROUNDS,
        root=_seconds(lambda: roots(1.5, ROUNDS)) / ROUNDS,
        throughput=2 * 64 * ROUNDS / _seconds(lambda: columns(y, ROUNDS)),
    )


def least(tape: Tape, columns: int, arithmetic: Arithmetic) -> float:
    """Seconds that a step of Runge and Kutta's method takes at least."""
    moved = tape.first + tape.begin
    ready = {int(slot): 0.0 for slot in tape.states}
    work = 0
    for i in range(tape.begin, len(tape.codes)):
        name, a, b = NAMES[int(tape.codes[i])], int(tape.left[i]), int(tape.right[i])
        operands = (a,) if name in UNARY else (a, b)
        there = [ready[j] for j in operands if j in ready]
        if there:
            ready[tape.first + i] = max(there) + arithmetic.latency(name)
            work += 2 * len(there) * columns
    chain = max((ready.get(int(rate), 0.0) for rate in tape.rates if rate >= moved), default=0.0)
    stages = 4
    # From one stage to the next: a product and a sum; likewise to the end of the step.
    chain = stages * (chain + 2 * arithmetic.sum)
    work = stages * (work + 4 * len(tape.states) * columns)
    return max(chain, work / arithmetic.throughput)


def _seconds(call: Callable[[], object]) -> float:
    """Least CPU time of some calls, the first of which compiles."""
    call()
    times = []
    for _ in range(9):
        begin = clock.process_time()
        call()
        times.append(clock.process_time() - begin)
    return statistics.median(sorted(times)[:3])
