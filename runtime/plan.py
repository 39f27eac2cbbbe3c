"""A plan: array operations as data, and the interpreter that runs them.

Values are numbered: first the inputs, then the constants, then one per operation. A plan is part
of the ruleset contract, so the compiler uses this very interpreter for its reference point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHUNK = 8192

OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "pow": np.power,
    "min": np.minimum,
    "max": np.maximum,
    "neg": np.negative,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "sign": np.sign,
    "exp": np.exp,
    "log": np.log,
    "tanh": np.tanh,
}
UNARY = frozenset({"neg", "sqrt", "abs", "sign", "exp", "log", "tanh"})

Operation = tuple[str, int, int]


@dataclass(frozen=True)
class Plan:
    """Operations ``(name, a, b)`` on numbered values; `b` is ignored by unary ones.

    `outputs` maps a name to the number of its value.
    """

    inputs: tuple[str, ...]
    constants: tuple[float, ...]
    operations: tuple[Operation, ...]
    outputs: Mapping[str, int] = field(repr=False)

    @cached_property
    def first_operation(self) -> int:
        """Number of the first operation's value."""
        return len(self.inputs) + len(self.constants)

    def select(self, outputs: Iterable[str]) -> Plan:
        """Keep what the named outputs need; unknown names raise KeyError."""
        kept = {name: self.outputs[name] for name in outputs}
        needed = self._needed(kept.values())
        renumber = {i: i for i in range(self.first_operation)}
        operations: list[Operation] = []
        for i in needed:
            name, a, b = self.operations[i - self.first_operation]
            renumber[i] = self.first_operation + len(operations)
            operations.append((name, renumber[a], 0 if name in UNARY else renumber[b]))
        outputs_ = {name: renumber[i] for name, i in kept.items()}
        return Plan(self.inputs, self.constants, tuple(operations), outputs_)

    def _needed(self, roots: Iterable[int]) -> list[int]:
        start = self.first_operation
        seen: set[int] = set()
        stack = [i for i in roots if i >= start]
        while stack:
            i = stack.pop()
            if i in seen:
                continue
            seen.add(i)
            name, a, b = self.operations[i - start]
            stack.extend(j for j in ((a,) if name in UNARY else (a, b)) if j >= start)
        return sorted(seen)

    def used_inputs(self) -> set[str]:
        """Names of the inputs that some operation or output reads."""
        used = set(self.outputs.values())
        for name, a, b in self.operations:
            used.add(a)
            if name not in UNARY:
                used.add(b)
        return {name for i, name in enumerate(self.inputs) if i in used}

    def run(self, values: Mapping[str, Array | float]) -> dict[str, Array]:
        """Evaluate all outputs.

        Parameters
        ----------
        values : per input name an array, shape (n,), or a number; SI. Absent inputs count as NaN.

        Returns
        -------
        Per output name an array, shape (n,); shape (1,) if every input is a number.
        """
        given = [values.get(name, np.nan) for name in self.inputs]
        lengths = {len(v) for v in given if isinstance(v, np.ndarray) and v.ndim}
        if len(lengths) > 1:
            raise ValueError(f"inputs of different length: {sorted(lengths)}")
        n = lengths.pop() if lengths else 1
        varying = tuple(isinstance(v, np.ndarray) and v.ndim > 0 for v in given)
        steps, buffers, scalars = self._schedule(varying)
        results = {name: np.empty(n) for name in self.outputs}
        with np.errstate(all="ignore"):
            fixed = self._scalars(given, scalars)
            for low in range(0, n, CHUNK):
                high = min(low + CHUNK, n)
                self._chunk(given, fixed, steps, buffers, results, low, high)
        return results

    def _schedule(
        self, varying: tuple[bool, ...]
    ) -> tuple[list[tuple[Any, int, int, int, int]], int, list[int]]:
        """Split operations into scalar ones and array steps with reused buffers.

        A step is ``(ufunc, a, b or -1, value, buffer)``.
        """
        start = self.first_operation
        is_array = list(varying) + [False] * len(self.constants)
        last: dict[int, int] = {}
        for i, (name, a, b) in enumerate(self.operations, start):
            is_array.append(is_array[a] or (name not in UNARY and is_array[b]))
            last[a] = i
            if name not in UNARY:
                last[b] = i
        kept = set(self.outputs.values())
        free: list[int] = []
        held: dict[int, int] = {}
        steps: list[tuple[Any, int, int, int, int]] = []
        scalars: list[int] = []
        count = 0
        for i, (name, a, b) in enumerate(self.operations, start):
            if not is_array[i]:
                scalars.append(i)
                continue
            operands = (a,) if name in UNARY else (a, b)
            buffer = -1
            if i not in kept:
                for j in {o for o in operands if last[o] == i and o in held}:
                    free.append(held.pop(j))
                buffer = free.pop() if free else count
                count += buffer == count
                held[i] = buffer
            else:
                for j in {o for o in operands if last[o] == i and o in held}:
                    free.append(held.pop(j))
            second = -1 if name in UNARY else b
            steps.append((OPERATIONS[name], a, second, i, buffer))
        return steps, count, scalars

    def _scalars(self, given: Sequence[Array | float], scalars: list[int]) -> dict[int, Any]:
        start = self.first_operation
        values: dict[int, Any] = {i: np.float64(v) for i, v in enumerate(given) if np.ndim(v) == 0}
        for i, constant in enumerate(self.constants, len(self.inputs)):
            values[i] = np.float64(constant)
        for i in scalars:
            name, a, b = self.operations[i - start]
            function = OPERATIONS[name]
            values[i] = function(values[a]) if name in UNARY else function(values[a], values[b])
        return values

    def _chunk(
        self,
        given: Sequence[Array | float],
        fixed: Mapping[int, Any],
        steps: list[tuple[Any, int, int, int, int]],
        buffers: int,
        results: dict[str, Array],
        low: int,
        high: int,
    ) -> None:
        values: list[Any] = [None] * (self.first_operation + len(self.operations))
        for i, value in fixed.items():
            values[i] = value
        for i, v in enumerate(given):
            if isinstance(v, np.ndarray) and v.ndim:
                values[i] = v[low:high]
        store = np.empty((buffers, high - low))
        target = {i: results[name][low:high] for name, i in self.outputs.items()}
        for function, a, b, i, buffer in steps:
            out = target[i] if buffer < 0 else store[buffer]
            if b < 0:
                function(values[a], out=out)
            else:
                function(values[a], values[b], out=out)
            values[i] = out
        for name, i in self.outputs.items():
            destination = results[name][low:high]
            if destination is not values[i]:
                destination[...] = values[i]
