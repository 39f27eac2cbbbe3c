"""A tape written as code for LLVM: straight lines of arithmetic, no interpreter between them.

The code is made from a tape alone: numbers of operations and of slots, never a name or a text that
somebody wrote. It does the same operations in the same order as the interpreter in
`integrator.py`, so results are the same to the last bit; it leaves out what nobody reads, and
terms whose derivative is zero whatever the parameters are.

Values come first, for all stages; with them the factors of all derivatives are known, and slopes
are sums of products, `LANES` columns at a time.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from rulec_runtime.contract.plan import UNARY
from rulec_runtime.simulation.tape import CODES, Tape

LANES = 4
"""Columns of slopes at a time: a register of AVX2 holds so many."""

EVALUATE = "evaluate"
"""``(values, slopes)``: run the moving operations, in place."""

ADVANCE = "advance"
"""``(values, slopes, x, dx, k, given, step)``: stages two to four of Runge and Kutta's method.

The first stage's rates stand in `values` and `slopes`. `k`, shape (4, states), is filled, `x` and
`dx`, shape (states, columns), are moved. `given`, shape (4, inputs + 1), has inputs and clock per
stage.
"""

NAMES = {code: name for name, code in CODES.items()}

WIDE = f"<{LANES} x double>"

ONE, MINUS = "one", "minus"
"""Factors that need no multiplication."""

Factor = tuple[str, int] | str | None
"""`ONE`, `MINUS`, where the factor stands (array and place), or None for zero."""


@dataclass(frozen=True)
class Numbers:
    """Numbers of the integrator that the code needs: edges of functions, nodes and weights of the
    stages; and the addresses of functions that LLVM has none of."""

    tiny: float
    steepest: float
    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    functions: Mapping[str, int]


def code_of(tape: Tape, flat: Iterable[int], columns: int, numbers: Numbers) -> str:
    """The code of a tape, with `EVALUATE`, and `ADVANCE` where no state has a dead time.

    `flat` are slots whose slopes are zero whatever the parameters: constants and what is given.
    `columns` is a multiple of `LANES`, or 0 without slopes.
    """
    zero = _without_slopes(tape, flat)
    moved = tape.first + tape.begin
    watched = [*tape.starts, *tape.rates, *tape.lows, *tape.highs, *tape.afters, *tape.outputs]
    stored = sorted({int(slot) for slot in watched if slot >= moved})
    parts = [_evaluate(_Lines(tape, zero, columns, numbers, stored), stored)]
    if not (tape.afters >= 0).any():
        parts.append(_advance(_Lines(tape, zero, columns, numbers, map(int, tape.rates))))
    return "\n".join([*parts, *_DECLARED])


def called(tape: Tape) -> frozenset[str]:
    """Names of the functions whose addresses the code of a tape needs."""
    names = {NAMES[int(code)] for code in tape.codes[tape.begin :]}
    return frozenset(names & CALLED) | (frozenset({"log"}) if "pow" in names else frozenset())


def _without_slopes(tape: Tape, flat: Iterable[int]) -> set[int]:
    """Slots whose slopes are zero whatever the parameters."""
    zero = {int(slot) for slot in flat} | {int(slot) for slot in tape.inputs}
    zero -= {int(slot) for slot in tape.states}
    if tape.clock >= 0:
        zero.add(tape.clock)
    for i, (code, a, b) in enumerate(zip(tape.codes, tape.left, tape.right, strict=True)):
        if NAMES[int(code)] == "sign" or (int(a) in zero and int(b) in zero):
            zero.add(tape.first + i)
    return zero


class _Code:
    """Lines of code; each result has a number."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._count = 0

    def put(self, what: str) -> str:
        """A line with a result; its name."""
        self._count += 1
        self.lines.append(f"  %r{self._count} = {what}")
        return f"%r{self._count}"

    def do(self, what: str) -> None:
        """A line without a result."""
        self.lines.append(f"  {what}")

    def at(self, base: str, index: int | str) -> str:
        """The address of a number of an array."""
        return self.put(f"getelementptr double, ptr {base}, i64 {index}")

    def load(self, base: str, index: int | str, kind: str = "double") -> str:
        """A number of an array, or `LANES` of them."""
        return self.put(f"load {kind}, ptr {self.at(base, index)}, align 8")

    def store(self, value: str, base: str, index: int | str, kind: str = "double") -> None:
        """Write a number, or `LANES` of them."""
        self.do(f"store {kind} {value}, ptr {self.at(base, index)}, align 8")

    def wide(self, value: str) -> str:
        """A number in all lanes."""
        one = self.put(f"insertelement {WIDE} poison, double {value}, i32 0")
        return self.put(
            f"shufflevector {WIDE} {one}, {WIDE} poison, <{LANES} x i32> zeroinitializer"
        )

    def calc(self, operation: str, a: str, b: str, kind: str = "double") -> str:
        """An operation of two operands."""
        return self.put(f"{operation} {kind} {a}, {b}")

    def choose(self, if_: str, a: str, b: str) -> str:
        """`a` where the condition holds, else `b`."""
        return self.put(f"select i1 {if_}, double {a}, double {b}")

    def call(self, function: int, *operands: str) -> str:
        """The result of a function at an address."""
        given = ", ".join(f"double {o}" for o in operands)
        return self.put(f"call double inttoptr (i64 {function} to ptr)({given})")

    def moved(self, base: str, scale: str, by: str | None, kind: str = "double") -> str:
        """`base` and a multiple of something, which None has none of."""
        if by is None:
            return base
        return self.calc("fadd", base, self.calc("fmul", scale, by, kind), kind)

    def by_columns(self, columns: int, body: Callable[[], None]) -> None:
        """A loop over columns, `LANES` at a time; the last one that a function may have."""
        self.do("br label %columns")
        self.lines.append("columns:")
        self.do("%column = phi i64 [ 0, %start ], [ %next_column, %columns ]")
        body()
        self.do(f"%next_column = add i64 %column, {LANES}")
        self.do(f"%more_columns = icmp ult i64 %next_column, {columns}")
        self.do("br i1 %more_columns, label %columns, label %done")
        self.lines.append("done:")

    def function(self, name: str, parameters: str, frame: int) -> str:
        """The whole function; `frame` numbers are kept on the stack."""
        begin = [f"define void {name}({parameters}) {{", "start:"]
        frame_ = f"  %frame = alloca double, i64 {max(frame, 1)}, align 8"
        return "\n".join([*begin, frame_, *self.lines, "  ret void", "}"])


def _number(value: float) -> str:
    """A number as LLVM writes it: its bits."""
    return f"0x{int.from_bytes(struct.pack('>d', value)):016X}"


def _add(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    return code.calc("fadd", x, y), ONE, ONE


def _sub(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    return code.calc("fsub", x, y), ONE, MINUS


def _mul(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    return code.calc("fmul", x, y), y, x


def _div(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    none = code.calc("fcmp oeq", y, _number(0.0))
    y = code.choose(none, _number(numbers.tiny), y)
    v = code.calc("fdiv", x, y)
    by_left = code.calc("fdiv", _number(1.0), y) if by[0] else None
    by_right = code.calc("fdiv", code.put(f"fneg double {v}"), y) if by[1] else None
    return v, by_left, by_right


def _pow(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    zero, one = _number(0.0), _number(1.0)
    base = code.choose(code.calc("fcmp olt", x, zero), zero, x)
    none = code.calc("fcmp oeq", base, zero)
    raised = code.call(numbers.functions["pow"], base, y)
    at_zero = code.choose(code.calc("fcmp ogt", y, zero), zero, one)
    v = code.choose(none, at_zero, raised)
    by_left = by_right = None
    if by[0]:
        steep = code.calc("fdiv", code.calc("fmul", y, v), base)
        line = code.choose(code.calc("fcmp oeq", y, one), y, zero)
        by_left = code.choose(none, line, steep)
    if by[1]:
        steep = code.calc("fmul", v, code.call(numbers.functions["log"], base))
        by_right = code.choose(none, zero, steep)
    return v, by_left, by_right


def _either(comparison: str) -> _Rule:
    def rule(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
        zero, one = _number(0.0), _number(1.0)
        left = code.calc(comparison, x, y)
        by_left = code.choose(left, one, zero) if by[0] else None
        by_right = code.choose(left, zero, one) if by[1] else None
        return code.choose(left, x, y), by_left, by_right

    return rule


def _neg(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    return code.put(f"fneg double {x}"), MINUS, None


def _sqrt(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    there = code.calc("fcmp ogt", x, _number(numbers.tiny))
    root = code.put(f"call double @llvm.sqrt.f64(double {x})")
    by_left = None
    if by[0]:
        by_left = code.choose(there, code.calc("fdiv", _number(0.5), root), _number(0.0))
    return code.choose(there, root, _number(0.0)), by_left, None


def _abs(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    up = code.calc("fcmp oge", x, _number(0.0))
    by_left = code.choose(up, _number(1.0), _number(-1.0)) if by[0] else None
    return code.put(f"call double @llvm.fabs.f64(double {x})"), by_left, None


def _sign(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    zero = _number(0.0)
    below = code.choose(code.calc("fcmp olt", x, zero), _number(-1.0), zero)
    return code.choose(code.calc("fcmp ogt", x, zero), _number(1.0), below), None, None


def _exp(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    most = _number(numbers.steepest)
    x = code.choose(code.calc("fcmp ogt", x, most), most, x)
    v = code.call(numbers.functions["exp"], x)
    return v, v, None


def _log(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    least = _number(numbers.tiny)
    x = code.choose(code.calc("fcmp olt", x, least), least, x)
    by_left = code.calc("fdiv", _number(1.0), x) if by[0] else None
    return code.call(numbers.functions["log"], x), by_left, None


def _tanh(code: _Code, numbers: Numbers, x: str, y: str, by: _By) -> _Ruled:
    v = code.call(numbers.functions["tanh"], x)
    by_left = code.calc("fsub", _number(1.0), code.calc("fmul", v, v)) if by[0] else None
    return v, by_left, None


_By = tuple[bool, bool]
"""Whether the derivatives by both operands are wanted."""

_Ruled = tuple[str, str | None, str | None]
"""The value, and its derivatives by both operands."""

_Rule = Callable[[_Code, Numbers, str, str, _By], _Ruled]

_RULES: Mapping[str, _Rule] = {
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "pow": _pow,
    "min": _either("fcmp ole"),
    "max": _either("fcmp oge"),
    "neg": _neg,
    "sqrt": _sqrt,
    "abs": _abs,
    "sign": _sign,
    "exp": _exp,
    "log": _log,
    "tanh": _tanh,
}
"""The operations, as `evaluate` in `integrator.py` has them."""

_DECLARED = (
    "declare double @llvm.sqrt.f64(double)",
    "declare double @llvm.fabs.f64(double)",
)

CALLED = frozenset({"pow", "exp", "log", "tanh"})
"""Operations that are functions at an address; the derivative of `pow` needs `log` beside it."""


class _Lines:
    """The moving operations that something reads, as lines of code."""

    def __init__(
        self, tape: Tape, zero: set[int], columns: int, numbers: Numbers, roots: Iterable[int]
    ) -> None:
        self.tape, self.zero, self.columns, self.numbers = tape, zero, columns, numbers
        self._moved = tape.first + tape.begin
        self._end = tape.first + len(tape.codes)
        needed: set[int] = set()
        stack = list(roots)
        while stack:
            slot = stack.pop()
            if self._moved <= slot < self._end and slot not in needed:
                needed.add(slot)
                stack += self._operands(slot)
        self._order = sorted(needed)

    def _name(self, slot: int) -> str:
        return NAMES[int(self.tape.codes[slot - self.tape.first])]

    def _operands(self, slot: int) -> tuple[int, int]:
        i = slot - self.tape.first
        return int(self.tape.left[i]), int(self.tape.right[i])

    def values(self, code: _Code, known: Mapping[int, str]) -> tuple[_Got, _Factors]:
        """Lines for all values; `known` are slots that stand elsewhere than in `values`."""
        there = dict(known)
        factors = _Factors()

        def value(slot: int) -> str:
            if slot not in there:
                there[slot] = code.load("%values", slot)
            return there[slot]

        for slot in self._order:
            name, (a, b) = self._name(slot), self._operands(slot)
            by_left = bool(self.columns) and a not in self.zero
            by_right = bool(self.columns) and b not in self.zero and name not in UNARY
            found, left, right = _RULES[name](
                code, self.numbers, value(a), value(b), (by_left, by_right)
            )
            there[slot] = found
            stays = {there[s]: s for s in (a, b) if s < self._moved and s not in known}
            factors.by[slot] = (
                factors.place(left, stays) if by_left else None,
                factors.place(right, stays) if by_right else None,
            )
        return value, factors

    def slopes(
        self, code: _Code, known: Mapping[int, str], factors: _Factors, frame: str
    ) -> _GotWide:
        """Lines for slopes in the columns from `%column` on; what is None is zero."""
        there: dict[int, str | None] = {**dict.fromkeys(self.zero, None), **known}

        def slope(slot: int) -> str | None:
            if slot not in there:
                there[slot] = self.kept_slope(code, slot)
            return there[slot]

        def term(slot: int, factor: Factor) -> tuple[str, str] | None:
            """How a term counts, and the term."""
            own = slope(slot) if factor is not None else None
            if own is None or factor is None:
                return None
            if isinstance(factor, str):
                return ("fadd" if factor == ONE else "fsub"), own
            base, place = factor
            number = code.load("%values" if base == "values" else frame, place)
            return "fadd", code.calc("fmul", code.wide(number), own, WIDE)

        for slot in self._order:
            operands = zip(self._operands(slot), factors.by[slot], strict=True)
            terms = [t for t in (term(s, f) for s, f in operands) if t is not None]
            total = None
            for how, one in terms:
                if total is None:
                    total = one if how == "fadd" else code.put(f"fneg {WIDE} {one}")
                else:
                    total = code.calc(how, total, one, WIDE)
            there[slot] = total
        return slope

    def kept_slope(self, code: _Code, slot: int) -> str | None:
        """Slopes as they stand in `slopes`."""
        if slot in self.zero:
            return None
        return code.load(self.row(code, "%slopes", slot), "%column", WIDE)

    def row(self, code: _Code, base: str, row: int) -> str:
        """The address of a row of slopes."""
        return code.at(base, row * self.columns)


_Got = Callable[[int], str]
_GotWide = Callable[[int], str | None]


class _Factors:
    """Where the factors of derivatives stand, per operation; `frame` are those to keep."""

    def __init__(self) -> None:
        self.by: dict[int, tuple[Factor, Factor]] = {}
        self.frame: dict[str, int] = {}

    def place(self, factor: str | None, stays: Mapping[str, int]) -> Factor:
        """Where a factor will stand; what stands in `values` needs no other place."""
        if factor is None or factor in (ONE, MINUS):
            return factor
        if factor in stays:
            return "values", stays[factor]
        return "frame", self.frame.setdefault(factor, len(self.frame))

    def keep(self, code: _Code, begin: int) -> None:
        """Lines that put factors into the frame, from a place on."""
        for number, place in self.frame.items():
            code.store(number, "%frame", begin + place)


def _evaluate(lines: _Lines, stored: list[int]) -> str:
    """The function `EVALUATE`."""
    code = _Code()
    value, factors = lines.values(code, {})
    for slot in stored:
        code.store(value(slot), "%values", slot)
    if lines.columns:
        factors.keep(code, 0)

        def body() -> None:
            slope = lines.slopes(code, {}, factors, "%frame")
            for slot in stored:
                found = slope(slot) or "zeroinitializer"
                code.store(found, lines.row(code, "%slopes", slot), "%column", WIDE)

        code.by_columns(lines.columns, body)
    return code.function(
        f"@{EVALUATE}", "ptr noalias %values, ptr noalias %slopes", len(factors.frame)
    )


def _advance(lines: _Lines) -> str:
    """The function `ADVANCE`: all values first, then slopes."""
    tape, numbers = lines.tape, lines.numbers
    states, rates = [[int(slot) for slot in slots] for slots in (tape.states, tape.rates)]
    given = [*(int(slot) for slot in tape.inputs), tape.clock]
    count, stages = len(states), range(1, len(numbers.nodes))
    code = _Code()
    scales = [code.calc("fmul", _number(node), "%step") for node in numbers.nodes]
    weights = [code.calc("fmul", "%step", _number(weight)) for weight in numbers.weights]
    begun = [code.load("%x", i) for i in range(count)]
    rate = [code.load("%values", slot) for slot in rates]
    ends = [code.moved(begun[i], weights[0], rate[i]) for i in range(count)]
    noted = []
    for i in range(count):
        code.store(rate[i], "%k", i)
    for stage in stages:
        known = {s: code.moved(begun[i], scales[stage], rate[i]) for i, s in enumerate(states)}
        for j, slot in enumerate(given):
            if slot >= 0:
                known[slot] = code.load("%given", stage * len(given) + j)
        value, factors = lines.values(code, known)
        noted.append(factors)
        rate = [value(slot) for slot in rates]
        ends = [code.moved(ends[i], weights[stage], rate[i]) for i in range(count)]
        for i in range(count):
            code.store(rate[i], "%k", stage * count + i)
    for i in range(count):
        code.store(ends[i], "%x", i)
    size = len(noted[0].frame)
    if lines.columns:
        for begin, factors in enumerate(noted):
            factors.keep(code, begin * size)
        scales, weights = [[code.wide(n) for n in own] for own in (scales, weights)]

        def body() -> None:
            rows = [lines.row(code, "%dx", i) for i in range(count)]
            begun = [code.load(row, "%column", WIDE) for row in rows]
            rate = [lines.kept_slope(code, slot) for slot in rates]
            ends = [code.moved(begun[i], weights[0], rate[i], WIDE) for i in range(count)]
            for stage in stages:
                known = {
                    slot: code.moved(begun[i], scales[stage], rate[i], WIDE)
                    for i, slot in enumerate(states)
                }
                frame = code.at("%frame", (stage - 1) * size)
                slope = lines.slopes(code, known, noted[stage - 1], frame)
                rate = [slope(slot) for slot in rates]
                ends = [code.moved(ends[i], weights[stage], rate[i], WIDE) for i in range(count)]
            for i in range(count):
                code.store(ends[i], rows[i], "%column", WIDE)

        code.by_columns(lines.columns, body)
    pointers = ("values", "slopes", "x", "dx", "k", "given")
    parameters = ", ".join(f"ptr noalias %{name}" for name in pointers)
    return code.function(f"@{ADVANCE}", f"{parameters}, double %step", len(stages) * size)
