"""A plan's array operations as code for LLVM: one loop over samples, values stay in registers.

The code is made from numbers of operations and values, never from text in the ruleset. It gives
numpy's results to the last bit, operation by operation; operations for which numpy has its own
function (exp, log, tanh, pow) stay with numpy, between two loops.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from rulec_runtime import limits
from rulec_runtime.machine_code.code import LANES, WIDE, Code, number

Step = tuple[Callable[..., Any], int, int, int]
"""``(ufunc, a, b, value)``; `b` is -1 for unary ones."""

Rule = Callable[[Code, str, str], str]

_SQRT, _FABS = (f"@llvm.{name}.v{LANES}f64" for name in ("sqrt", "fabs"))
_DECLARED = tuple(f"declare {WIDE} {name}({WIDE})" for name in (_SQRT, _FABS))


def _plain(operation: str) -> Rule:
    return lambda code, x, y: code.calc(operation, x, y, WIDE)


def _either(comparison: str) -> Rule:
    """The first operand if the comparison holds or it is NaN, else the second."""

    def rule(code: Code, x: str, y: str) -> str:
        found = code.choose(code.calc(comparison, x, y, WIDE), x, y, WIDE)
        return code.choose(code.calc("fcmp uno", x, x, WIDE), x, found, WIDE)

    return rule


def _sign(code: Code, x: str, _: str) -> str:
    zero = "zeroinitializer"
    found = code.choose(code.calc("fcmp oeq", x, zero, WIDE), zero, x, WIDE)
    below = code.choose(code.calc("fcmp olt", x, zero, WIDE), code.wide(number(-1.0)), found, WIDE)
    return code.choose(code.calc("fcmp ogt", x, zero, WIDE), code.wide(number(1.0)), below, WIDE)


RULES: Mapping[Callable[..., Any], Rule] = {
    np.add: _plain("fadd"),
    np.subtract: _plain("fsub"),
    np.multiply: _plain("fmul"),
    np.divide: _plain("fdiv"),
    np.minimum: _either("fcmp olt"),
    np.maximum: _either("fcmp ogt"),
    np.negative: lambda code, x, _: code.put(f"fneg {WIDE} {x}"),
    np.sqrt: lambda code, x, _: code.put(f"call {WIDE} {_SQRT}({WIDE} {x})"),
    np.absolute: lambda code, x, _: code.put(f"call {WIDE} {_FABS}({WIDE} {x})"),
    np.sign: _sign,
}
"""Operations that have code; numpy does all others."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The parts in which steps run, and the places of values.

    A part is one loop over samples, or one operation of numpy. `numbers` are values without
    samples, in the order in which the code reads them. `inputs`, `targets` and `rows` are values
    with samples: those given, those wanted by the caller, and those that one part leaves for
    another; `place` numbers them in this order, but rows are reused after their last use.
    """

    parts: tuple[tuple[Step, ...], ...]
    numbers: tuple[int, ...]
    inputs: tuple[int, ...]
    targets: tuple[int, ...]
    place: Mapping[int, int]
    rows: int

    @property
    def arrays(self) -> int:
        """Number of arrays before the rows."""
        return len(self.inputs) + len(self.targets)


def layout_of(steps: Sequence[Step], inputs: Sequence[int], targets: Sequence[int]) -> Layout:
    """Lay out steps, each of which follows what it reads; `inputs` are the values with samples."""
    parts = _parts(steps)
    made = {step[3]: part for part, own in enumerate(parts) for step in own}
    last: dict[int, int] = {}
    read: dict[int, None] = {}
    for part, own in enumerate(parts):
        for _, a, b, _ in own:
            for value in (a, b) if b >= 0 else (a,):
                last[value] = part
                read[value] = None
    given = [value for value in inputs if value in read]
    place = {value: i for i, value in enumerate([*given, *targets])}
    arrays, rows = len(place), 0
    free: list[int] = []
    leaving: dict[int, list[int]] = {}
    for part, own in enumerate(parts):
        for *_, value in own:
            if value not in place and last.get(value, part) > part:
                row = free.pop() if free else rows
                rows = max(rows, row + 1)
                place[value] = arrays + row
                leaving.setdefault(last[value], []).append(row)
        free += leaving.get(part, [])
    return Layout(
        parts=parts,
        numbers=tuple(value for value in read if value not in made and value not in place),
        inputs=tuple(given),
        targets=tuple(targets),
        place=place,
        rows=rows,
    )


def _parts(steps: Sequence[Step]) -> tuple[tuple[Step, ...], ...]:
    """Loops and operations of numpy in turn; long loops are split, as LLVM compiles them slowly."""
    level: dict[int, int] = {}
    keyed = []
    for step in steps:
        function, a, b, value = step
        own = max(level.get(a, 0), level.get(b, 0))
        called = function not in RULES
        level[value] = own + called
        keyed.append(((own, called), step))
    keyed.sort(key=lambda pair: pair[0])
    parts: list[tuple[Step, ...]] = []
    for (_, called), pairs in groupby(keyed, key=lambda pair: pair[0]):
        own_steps = [step for _, step in pairs]
        most = 1 if called else limits.PLAN_LOOP
        parts += [tuple(own_steps[i : i + most]) for i in range(0, len(own_steps), most)]
    return tuple(parts)


def is_loop(part: Sequence[Step]) -> bool:
    """Whether a part has code; else it is one operation of numpy."""
    return part[0][0] in RULES


def code_of(layout: Layout, name: str) -> str:
    """Functions ``<name>_<part>(at, numbers, low, high)`` for samples from low to high.

    `at` holds the address of every array; rows begin at the sample `low`. The number of samples is
    a multiple of `LANES`.
    """
    functions = [
        _function(layout, part, f"@{name}_{i}")
        for i, part in enumerate(layout.parts)
        if is_loop(part)
    ]
    return "\n".join([*functions, *_DECLARED])


def _function(layout: Layout, part: Sequence[Step], name: str) -> str:
    code = Code()
    numbered = {value: i for i, value in enumerate(layout.numbers)}
    there: dict[int, str] = {}

    def address(value: int) -> tuple[str, str]:
        """The address of an array, and the index of its samples."""
        place = layout.place[value]
        base = code.put(f"getelementptr ptr, ptr %at, i64 {place}")
        column = "%column" if place < layout.arrays else "%inside"
        return code.put(f"load ptr, ptr {base}, align 8"), column

    def got(value: int) -> str:
        if value not in there:
            if value in numbered:
                there[value] = code.wide(code.load("%numbers", numbered[value]))
            else:
                there[value] = code.load(*address(value), WIDE)
        return there[value]

    def body() -> None:
        code.do("%inside = sub i64 %column, %low")
        for function, a, b, value in part:
            x = got(a)
            there[value] = RULES[function](code, x, got(b) if b >= 0 else x)
            if value in layout.place:
                code.store(there[value], *address(value), WIDE)

    code.by_columns("%high", body, "%low")
    return code.function(name, "ptr %at, ptr %numbers, i64 %low, i64 %high", 0)
