"""A plan: array operations as data, and the interpreter that runs them.

Values are numbered: first the inputs, then the constants, then one per operation. A plan is part of
the ruleset contract, so the compiler uses this interpreter for its reference point too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits

Array = NDArray[np.float64]

CHUNK = 16384
"""Samples at a time: with fewer, numpy's calls dominate; with more, the data leave the cache."""

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

ABSENT = np.asarray(np.nan)
"""Value of a missing input."""

Operation = tuple[str, int, int]

Step = tuple[Callable[..., Any], int, int, int]
"""``(ufunc, a, b, value)``; `b` is -1 for unary ones."""


@dataclass(frozen=True)
class Plan:
    """Operations ``(name, a, b)`` on numbered values; unary ones ignore `b`.

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
        """Keep what the named outputs need; raises KeyError for unknown names.

        The same names give the same plan object, so its schedule is worked out once.
        """
        names = tuple(outputs)
        return cached_plan(self._selections, names, lambda: self.selected(names))

    def narrowed(self) -> Plan:
        """The same plan without the inputs and constants that it does not read."""
        used = self._used
        first = len(self.inputs)
        inputs = [i for i in range(first) if i in used]
        constants = [i for i in range(first, self.first_operation) if i in used]
        end = self.first_operation + len(self.operations)
        left = [*inputs, *constants, *range(self.first_operation, end)]
        new = {i: j for j, i in enumerate(left)}
        return Plan(
            tuple(self.inputs[i] for i in inputs),
            tuple(self.constants[i - first] for i in constants),
            tuple((name, new[a], 0 if name in UNARY else new[b]) for name, a, b in self.operations),
            {name: new[i] for name, i in self.outputs.items()},
        )

    @cached_property
    def _selections(self) -> dict[tuple[str, ...], Plan]:
        return {}

    def selected(self, outputs: Iterable[str]) -> Plan:
        """As `select`, but always a new plan."""
        chosen = {name: self.outputs[name] for name in outputs}
        needed = self.needed(chosen.values())
        renumber = {i: i for i in range(self.first_operation)}
        operations: list[Operation] = []
        for i in sorted(needed):
            name, a, b = self.operations[i - self.first_operation]
            renumber[i] = self.first_operation + len(operations)
            operations.append((name, renumber[a], 0 if name in UNARY else renumber[b]))
        outputs_ = {name: renumber[i] for name, i in chosen.items()}
        return Plan(self.inputs, self.constants, tuple(operations), outputs_)

    def needed(self, roots: Iterable[int]) -> list[int]:
        """Operations that the roots need, one root after the other, each after its operands.

        This order keeps few values alive at a time.
        """
        order: list[int] = []
        visited: set[int] = set()
        stack = [(i, False) for i in roots][::-1]
        while stack:
            i, operands_done = stack.pop()
            if operands_done:
                order.append(i)
            elif i >= self.first_operation and i not in visited:
                visited.add(i)
                name, a, b = self.operations[i - self.first_operation]
                stack.append((i, True))
                stack += [(j, False) for j in ((a,) if name in UNARY else (a, b))]
        return order

    @cached_property
    def used_inputs(self) -> frozenset[str]:
        """Names of the inputs that an operation or output reads."""
        return frozenset(name for i, name in enumerate(self.inputs) if i in self._used)

    @cached_property
    def _used(self) -> frozenset[int]:
        """Numbers of the values that an operation or output reads."""
        used = set(self.outputs.values())
        for name, a, b in self.operations:
            used.add(a)
            if name not in UNARY:
                used.add(b)
        return frozenset(used)

    @cached_property
    def _schedules(self) -> dict[tuple[bool, ...], _Schedule]:
        return {}

    def run(
        self, values: Mapping[str, Array | float], out: Mapping[str, Array] | None = None
    ) -> dict[str, Array]:
        """Evaluate all outputs.

        Parameters
        ----------
        values : per input name an array, shape (n,), or a number; SI. Absent inputs count as NaN.
        out : per output name an array to write to, shape (n,), that shares no memory with `values`.
            Fresh memory costs more than the calculation, so run a long recording block by block
            into the same arrays.

        Returns
        -------
        Per output name an array, shape (n,); shape (1,) if every input is a number.
        """
        given = [np.asarray(values.get(name, ABSENT), dtype=float) for name in self.inputs]
        lengths = {len(v) for v in given if v.ndim}
        if len(lengths) > 1:
            raise ValueError(f"inputs of different length: {sorted(lengths)}")
        n = lengths.pop() if lengths else 1
        varying = tuple(v.ndim > 0 for v in given)
        if varying not in self._schedules:
            self._schedules[varying] = self._schedule(varying)
        schedule = self._schedules[varying]
        found: dict[str, Array] = {}
        with np.errstate(all="ignore"):
            fixed = self._fixed(given, schedule)
            if schedule.steps:
                found = _run_steps(schedule, fixed, out, n)
        results = {}
        for name, i in self.outputs.items():
            if schedule.targets.get(i) == name:
                results[name] = found[name]
                continue
            results[name] = np.empty(n) if out is None else out[name]
            results[name][...] = found[schedule.targets[i]] if i in schedule.targets else fixed[i]
        return results

    def _fixed(self, given: Sequence[Array], schedule: _Schedule) -> list[Any]:
        """All values that need no chunks: inputs as they are, constants and scalar operations.

        Numbers are arrays without dimension: numpy takes them faster than floats.
        """
        values: list[Any] = [*given, *self._constants]
        values += [None] * len(self.operations)
        for function, a, b, i in schedule.scalars:
            values[i] = np.asarray(function(values[a]) if b < 0 else function(values[a], values[b]))
        return values

    @cached_property
    def _constants(self) -> list[Array]:
        return [np.asarray(c) for c in self.constants]

    def _schedule(self, varying: tuple[bool, ...]) -> _Schedule:
        """Split operations into scalars and array steps; a buffer is reused after its last use."""
        is_array = [*varying, *[False] * (len(self.constants) + len(self.operations))]
        order = [
            (i, *self.operations[i - self.first_operation])
            for i in self.needed(self.outputs.values())
        ]
        last: dict[int, int] = {}
        for i, name, a, b in order:
            operands = (a,) if name in UNARY else (a, b)
            is_array[i] = any(is_array[j] for j in operands)
            last.update(dict.fromkeys(operands, i))
        targets = {i: n for n, i in self.outputs.items() if i >= self.first_operation}
        targets = {i: n for i, n in targets.items() if is_array[i]}
        free: list[int] = []
        in_use: dict[int, int] = {}
        rows: dict[int, int] = {}
        steps: dict[bool, list[Step]] = {True: [], False: []}
        count = 0
        for i, name, a, b in order:
            operands = (a,) if name in UNARY else (a, b)
            steps[is_array[i]].append((OPERATIONS[name], a, -1 if name in UNARY else b, i))
            free += [in_use.pop(j) for j in set(operands) if j in in_use and last[j] == i]
            if is_array[i] and i not in targets:
                rows[i] = in_use[i] = free.pop() if free else count
                count = max(count, rows[i] + 1)
        return _Schedule(
            scalars=tuple(steps[False]),
            steps=tuple(steps[True]),
            varying=varying,
            rows=rows,
            count=count,
            targets=targets,
        )


def cached_plan(plans: dict[Any, Plan], key: Any, made: Callable[[], Plan]) -> Plan:
    """The plan cached under a key, or a new one; the least recently used plans are dropped."""
    found = plans.pop(key, None) or made()
    while len(plans) >= limits.PLANS_CACHED:
        del plans[next(iter(plans))]
    plans[key] = found
    return found


@dataclass(frozen=True, kw_only=True)
class _Schedule:
    """How to run a plan once it is known which inputs are arrays.

    `scalars` work on numbers alone and run once, `steps` run on chunks. The value of a step goes to
    a row of the buffer (`rows`) or straight into an output (`targets`).
    """

    scalars: tuple[Step, ...]
    steps: tuple[Step, ...]
    varying: tuple[bool, ...]
    rows: Mapping[int, int]
    count: int
    targets: Mapping[int, str]


def _run_steps(
    schedule: _Schedule, fixed: Sequence[Any], out: Mapping[str, Array] | None, n: int
) -> dict[str, Array]:
    """Run the array steps chunk by chunk, so that the buffers stay in the cache."""
    names = schedule.targets.values()
    results = {name: np.empty(n) if out is None else out[name] for name in names}
    store = np.empty((schedule.count, min(n, CHUNK)))
    for low in range(0, n, CHUNK):
        high = min(low + CHUNK, n)
        buffers = list(store[:, : high - low])
        values = list(fixed)
        for i, is_array in enumerate(schedule.varying):
            if is_array:
                values[i] = fixed[i][low:high]
        for i, row in schedule.rows.items():
            values[i] = buffers[row]
        for i, name in schedule.targets.items():
            values[i] = results[name][low:high]
        for function, a, b, i in schedule.steps:
            if b < 0:
                function(values[a], out=values[i])
            else:
                function(values[a], values[b], out=values[i])
    return results
