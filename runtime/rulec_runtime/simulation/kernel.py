"""Machine code of a tape, by numba's own LLVM; making it takes some hundredths of a second.

The interpreter reads a tape that is integrated a few times; frequent ones get code. The results are
the same, so the moment does not matter.
"""

from __future__ import annotations

import importlib.util
import itertools
import math
import threading
from collections.abc import Iterable
from functools import cache
from typing import Any

from rulec_runtime.limits import KERNEL_WORTH
from rulec_runtime.simulation.kernel_code import (
    ADVANCE,
    EVALUATE,
    JACOBIAN,
    advance_code_of,
    called,
    evaluate_code_of,
    jacobian_code_of,
)
from rulec_runtime.simulation.kernel_rules import Numbers
from rulec_runtime.simulation.tape import Kernel, Tape

Key = tuple[str, int]
"""A function of `kernel_code`, and the number of columns."""

_NUMBERS = itertools.count()
_ONE_AT_A_TIME = threading.RLock()
"""Held while something is made: all threads share LLVM's engine."""


class Kernels:
    """The kernels of one tape; each function is made once it pays.

    `flat` are slots whose slopes are zero for any parameters.
    """

    def __init__(self, tape: Tape, flat: Iterable[int]) -> None:
        self._tape, self._flat = tape, tuple(flat)
        self._late = bool((tape.afters >= 0).any())
        self._steps: dict[Key, int] = {}
        self.made: dict[Key, int] = {}

    def __reduce__(self) -> tuple[type[Kernels], tuple[Tape, tuple[int, ...]]]:
        """A copy makes its own: machine code belongs to one process."""
        return Kernels, (self._tape, self._flat)

    def kernel(self, columns: int) -> Kernel:
        """What has been made for so many columns."""
        return Kernel(
            evaluate=self._address((EVALUATE, columns)),
            advance=0 if self._late else self._address((ADVANCE, columns)),
            jacobian=self._address((JACOBIAN, 0)),
        )

    def _address(self, key: Key) -> int:
        if key not in self.made:
            if self._steps.get(key, 0) < KERNEL_WORTH or not there_is_llvm():
                return 0
            self.made[key] = made(key[0], self._code(*key))
        return self.made[key]

    def _code(self, name: str, columns: int) -> str:
        from rulec_runtime.simulation.integrator import NODES, STEEPEST, TINY, WEIGHTS

        numbers = Numbers(
            tiny=TINY,
            steepest=STEEPEST,
            nodes=tuple(NODES[0].tolist()),
            weights=tuple(WEIGHTS.tolist()),
            functions={name: _function(name).address for name in called(self._tape)},
        )
        if name == JACOBIAN:
            return jacobian_code_of(self._tape, numbers)
        code_of = advance_code_of if name == ADVANCE else evaluate_code_of
        return code_of(self._tape, self._flat, columns, numbers)

    def count(self, columns: int, steps: int, implicit: bool) -> None:
        """Count steps with so many columns, most of them implicit or not."""
        keys = [(EVALUATE, columns)]
        if implicit:
            keys.append((JACOBIAN, 0))
        elif not self._late:
            keys.append((ADVANCE, columns))
        for key in keys:
            self._steps[key] = self._steps.get(key, 0) + steps


@cache
def _function(name: str) -> Any:
    """A function as the interpreter has it: LLVM alone may have another, or none."""
    from numba import cfunc

    def power(x: float, y: float) -> float:
        return float(x**y)

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
    return cfunc(kind, error_model="numpy")(function)


@cache
def there_is_llvm() -> bool:
    """Whether machine code can be made here: it comes with numba, an extra."""
    return importlib.util.find_spec("numba") is not None


def made(name: str, code: str) -> int:
    """The address of a function, made for this machine; it lives as long as the process.

    The source is released: a function takes 30 kB, with its source 0.8 MB.
    """
    import llvmlite.binding as llvm

    with _ONE_AT_A_TIME:
        engine = _engine()
        module = llvm.parse_assembly(code)
        own = f"{name}_{next(_NUMBERS)}"
        module.get_function(name).name = own
        engine.add_module(module)
        engine.finalize_object()
        address = int(engine.get_function_address(own))
        engine.remove_module(module)
        module.close()
    return address


@cache
def _engine() -> Any:
    """An engine for this machine.

    LLVM optimises little: more would take longer than it saves.
    """
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=0, jit=True
    )
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
