"""Code for LLVM, line by line: made from numbers alone, never from a file's text."""

import struct
from collections.abc import Callable

LANES = 4
"""Numbers at a time: an AVX2 register holds so many."""

WIDE = f"<{LANES} x double>"


class Code:
    """Lines of code; each result has a number."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._count = 0

    def put(self, what: str) -> str:
        """Add a line with a result; its name."""
        self._count += 1
        self.lines.append(f"  %r{self._count} = {what}")
        return f"%r{self._count}"

    def do(self, what: str) -> None:
        """Add a line without a result."""
        self.lines.append(f"  {what}")

    def at(self, base: str, index: int | str) -> str:
        """The address of an element of an array."""
        return self.put(f"getelementptr double, ptr {base}, i64 {index}")

    def load(self, base: str, index: int | str, kind: str = "double") -> str:
        """An element of an array, or `LANES` of them."""
        return self.put(f"load {kind}, ptr {self.at(base, index)}, align 8")

    def store(self, value: str, base: str, index: int | str, kind: str = "double") -> None:
        """Write an element, or `LANES` of them."""
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

    def choose(self, if_: str, a: str, b: str, kind: str = "double") -> str:
        """`a` where the condition holds, else `b`; lane by lane."""
        flag = "i1" if kind == "double" else f"<{LANES} x i1>"
        return self.put(f"select {flag} {if_}, {kind} {a}, {kind} {b}")

    def call(self, function: int, *operands: str) -> str:
        """The result of a function at an address."""
        given = ", ".join(f"double {o}" for o in operands)
        return self.put(f"call double inttoptr (i64 {function} to ptr)({given})")

    def moved(self, base: str, scale: str, by: str | None, kind: str = "double") -> str:
        """`base` plus `scale` times `by`; `base` alone if `by` is None."""
        if by is None:
            return base
        return self.calc("fadd", base, self.calc("fmul", scale, by, kind), kind)

    def by_columns(self, end: int, body: Callable[[], None]) -> None:
        """A loop over columns, `LANES` at a time; the only and last one of a function."""
        self.do("br label %columns")
        self.lines.append("columns:")
        self.do("%column = phi i64 [ 0, %start ], [ %next_column, %columns ]")
        body()
        self.do(f"%next_column = add i64 %column, {LANES}")
        self.do(f"%more_columns = icmp ult i64 %next_column, {end}")
        self.do("br i1 %more_columns, label %columns, label %done")
        self.lines.append("done:")

    def function(self, name: str, parameters: str, frame: int) -> str:
        """The whole function; `frame` numbers are kept on the stack."""
        begin = [f"define void {name}({parameters}) {{", "start:"]
        frame_ = f"  %frame = alloca double, i64 {max(frame, 1)}, align 8"
        return "\n".join([*begin, frame_, *self.lines, "  ret void", "}"])


def number(value: float) -> str:
    """A number in LLVM's notation: its bits."""
    return f"0x{int.from_bytes(struct.pack('>d', value)):016X}"
