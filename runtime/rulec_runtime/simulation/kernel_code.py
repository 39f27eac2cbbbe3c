"""A tape written as code for LLVM: straight lines of arithmetic, without an interpreter.

The code is made from a tape alone: numbers of operations and slots, never a name or text from a
user. It does the same operations in the same order as the interpreter in `integrator.py`, so
results are the same to the last bit; it omits unused values, and terms whose derivative is zero for
any parameters.

Values come first, for all stages; they give the factors of all derivatives, and slopes are sums of
products, `LANES` columns at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from rulec_runtime.contract.plan import UNARY
from rulec_runtime.simulation.kernel_rules import CALLED, DECLARED, MINUS, ONE, RULES, Numbers
from rulec_runtime.simulation.llvm_code import LANES, WIDE, Code, number
from rulec_runtime.simulation.tape import CODES, Tape

EVALUATE = "evaluate"
"""``(values, slopes)``: run the moving operations, in place."""

ADVANCE = "advance"
"""``(values, slopes, x, dx, k, given, step)``: stages two to four of Runge and Kutta's method.

The first stage's rates are in `values` and `slopes`. `k`, shape (4, states), is filled, `x` and
`dx`, shape (states, columns), are moved. `given`, shape (4, inputs + 1), has inputs and clock per
stage.
"""

JACOBIAN = "jacobian"
"""``(values, slopes)``: as `EVALUATE`, for slopes by the states alone."""

NAMES = {code: name for name, code in CODES.items()}

Factor = tuple[str, int] | str | None
"""`ONE`, `MINUS`, the place of the factor (array and index), or None for zero."""


def evaluate_code_of(tape: Tape, flat: Iterable[int], columns: int, numbers: Numbers) -> str:
    """The code of a tape for `EVALUATE`.

    `flat` are slots whose slopes are zero for any parameters: constants and inputs. `columns` is a
    multiple of `LANES`, or 0 without slopes.
    """
    zero, stored = _without_slopes(tape, flat), _watched(tape)
    lines = _Lines(tape, zero, columns, numbers, stored)
    return "\n".join([_evaluate(EVALUATE, lines, stored), *DECLARED])


def advance_code_of(tape: Tape, flat: Iterable[int], columns: int, numbers: Numbers) -> str:
    """The same for `ADVANCE`; no state may have a dead time."""
    zero, rates = _without_slopes(tape, flat), [int(slot) for slot in tape.rates]
    lines = _Lines(tape, zero, columns, numbers, rates)
    return "\n".join([_advance(lines), *DECLARED])


def jacobian_code_of(tape: Tape, numbers: Numbers) -> str:
    """The same for `JACOBIAN`; columns are states, rounded up to `LANES`."""
    zero, stored = _without_slopes(tape, range(tape.first + tape.begin)), _watched(tape)
    lines = _Lines(tape, zero, padded(len(tape.states)), numbers, stored)
    return "\n".join([_evaluate(JACOBIAN, lines, stored), *DECLARED])


def padded(width: int) -> int:
    """A number of columns, rounded up to `LANES`."""
    return -(-width // LANES) * LANES


def _watched(tape: Tape) -> list[int]:
    """Moving slots that the integrator reads."""
    read = [*tape.starts, *tape.rates, *tape.lows, *tape.highs, *tape.afters, *tape.outputs]
    return sorted({int(slot) for slot in read if slot >= tape.first + tape.begin})


def called(tape: Tape) -> frozenset[str]:
    """Names of the functions whose addresses the code of a tape needs."""
    names = {NAMES[int(code)] for code in tape.codes[tape.begin :]}
    return frozenset(names & CALLED) | (frozenset({"log"}) if "pow" in names else frozenset())


def _without_slopes(tape: Tape, flat: Iterable[int]) -> set[int]:
    """Slots whose slopes are zero for any parameters."""
    zero = {int(slot) for slot in flat} | {int(slot) for slot in tape.inputs}
    zero -= {int(slot) for slot in tape.states}
    if tape.clock >= 0:
        zero.add(tape.clock)
    for i, (code, a, b) in enumerate(zip(tape.codes, tape.left, tape.right, strict=True)):
        if NAMES[int(code)] == "sign" or (int(a) in zero and int(b) in zero):
            zero.add(tape.first + i)
    return zero


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

    def _operands(self, slot: int) -> tuple[int, int]:
        i = slot - self.tape.first
        return int(self.tape.left[i]), int(self.tape.right[i])

    def values(self, code: Code, known: Mapping[int, str]) -> tuple[_Got, _Factors]:
        """Lines for all values; `known` are slots that are not in `values`."""
        there = dict(known)
        factors = _Factors()

        def value(slot: int) -> str:
            if slot not in there:
                there[slot] = code.load("%values", slot)
            return there[slot]

        for slot in self._order:
            name = NAMES[int(self.tape.codes[slot - self.tape.first])]
            a, b = self._operands(slot)
            by_left = bool(self.columns) and a not in self.zero
            by_right = bool(self.columns) and b not in self.zero and name not in UNARY
            found, left, right = RULES[name](
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
        self, code: Code, known: Mapping[int, str], factors: _Factors, frame: str
    ) -> _GotWide:
        """Lines for slopes in the columns from `%column` on; None is zero."""
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
            by = code.load("%values" if base == "values" else frame, place)
            return "fadd", code.calc("fmul", code.wide(by), own, WIDE)

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

    def kept_slope(self, code: Code, slot: int) -> str | None:
        """Slopes from the array `slopes`."""
        if slot in self.zero:
            return None
        return code.load(self.row(code, "%slopes", slot), "%column", WIDE)

    def row(self, code: Code, base: str, row: int) -> str:
        """The address of a row of slopes."""
        return code.at(base, row * self.columns)


_Got = Callable[[int], str]
_GotWide = Callable[[int], str | None]


class _Factors:
    """Places of the factors of derivatives, per operation; `frame` are those to keep."""

    def __init__(self) -> None:
        self.by: dict[int, tuple[Factor, Factor]] = {}
        self.frame: dict[str, int] = {}

    def place(self, factor: str | None, stays: Mapping[str, int]) -> Factor:
        """The place of a factor; what is in `values` needs no other."""
        if factor is None or factor in (ONE, MINUS):
            return factor
        if factor in stays:
            return "values", stays[factor]
        return "frame", self.frame.setdefault(factor, len(self.frame))

    def keep(self, code: Code, begin: int) -> None:
        """Lines that store factors in the frame, from a place on."""
        for factor, place in self.frame.items():
            code.store(factor, "%frame", begin + place)


def _evaluate(name: str, lines: _Lines, stored: list[int]) -> str:
    code = Code()
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
    return code.function(f"@{name}", "ptr noalias %values, ptr noalias %slopes", len(factors.frame))


def _advance(lines: _Lines) -> str:
    tape, numbers = lines.tape, lines.numbers
    states, rates = [[int(slot) for slot in slots] for slots in (tape.states, tape.rates)]
    given = [*(int(slot) for slot in tape.inputs), tape.clock]
    count, stages = len(states), range(1, len(numbers.nodes))
    code = Code()
    scales = [code.calc("fmul", number(node), "%step") for node in numbers.nodes]
    weights = [code.calc("fmul", "%step", number(weight)) for weight in numbers.weights]
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
