"""Machine code of a tape: made by numba's own LLVM, some hundredths of a second a tape.

A tape that is integrated a few times is read by the interpreter; code is made for one that comes
often. Results are the same, so it does not matter when.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from typing import Any

from rulec_runtime.limits import KERNEL_WORTH
from rulec_runtime.simulation.kernel_code import (
    ADVANCE,
    EVALUATE,
    Numbers,
    called,
    code_of,
)
from rulec_runtime.simulation.tape import NO_KERNEL, Kernel, Tape


class Kernels:
    """The kernels of one tape, by number of columns; made when they have been worth it.

    `flat` are slots whose slopes are zero whatever the parameters.
    """

    def __init__(self, tape: Tape, flat: Iterable[int]) -> None:
        self._tape, self._flat = tape, tuple(flat)
        self._steps: dict[int, int] = {}
        self._made: dict[int, tuple[Kernel, Any]] = {}

    def kernel(self, columns: int) -> Kernel:
        """The kernel, if it has been made."""
        if columns not in self._made:
            if self._steps.get(columns, 0) < KERNEL_WORTH:
                return NO_KERNEL
            self._made[columns] = _made(self._tape, self._flat, columns)
        return self._made[columns][0]

    def count(self, columns: int, steps: int) -> None:
        """Steps were taken with so many columns."""
        self._steps[columns] = self._steps.get(columns, 0) + steps


def _made(tape: Tape, flat: tuple[int, ...], columns: int) -> tuple[Kernel, Any]:
    """A kernel, and what must live as long as it."""
    try:
        import llvmlite.binding as llvm
    except ImportError:  # no numba: the interpreter is all there is
        return NO_KERNEL, None

    from rulec_runtime.simulation.integrator import NODES, STEEPEST, TINY, WEIGHTS

    numbers = Numbers(
        tiny=TINY,
        steepest=STEEPEST,
        nodes=tuple(NODES[0].tolist()),
        weights=tuple(WEIGHTS.tolist()),
        functions={name: _function(name).address for name in called(tape)},
    )
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = llvm.parse_assembly(code_of(tape, flat, columns, numbers))
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=2,
        jit=True,
    )
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    late = bool((tape.afters >= 0).any())
    advance = 0 if late else engine.get_function_address(ADVANCE)
    return Kernel(engine.get_function_address(EVALUATE), advance), engine


@cache
def _function(name: str) -> Any:
    """A function as the interpreter has it: LLVM alone may know another, or none."""
    from numba import cfunc

    from rulec_runtime.simulation.integrator import PLAIN

    def power(x: float, y: float) -> float:
        return x**y

    def exp(x: float) -> float:
        return math.exp(x)

    def log(x: float) -> float:
        return math.log(x)

    def tanh(x: float) -> float:
        return math.tanh(x)

    one, two = "float64(float64)", "float64(float64, float64)"
    kind, function = {
        "pow": (two, power),
        "exp": (one, exp),
        "log": (one, log),
        "tanh": (one, tanh),
    }[name]
    return cfunc(kind, error_model=PLAIN["error_model"])(function)
