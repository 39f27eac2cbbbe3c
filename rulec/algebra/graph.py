"""Builds a plan node by node; equal nodes are shared, and constants are folded."""

import math
from collections.abc import Iterable, Mapping

import numpy as np
from rulec_runtime.contract.plan import OPERATIONS, UNARY, Plan

Node = int


class Graph:
    """A growing set of numbered operations; `plan` freezes it."""

    def __init__(self, inputs: Iterable[str]) -> None:
        self._inputs: list[str] = list(inputs)
        self._kinds: list[tuple[str, int, int]] = []
        self._constants: dict[float, Node] = {}
        self._nodes: dict[tuple[str, int, int], Node] = {}
        self._values: dict[Node, float] = {}
        self._named = {name: self._append(("input", i, 0)) for i, name in enumerate(self._inputs)}
        self.outputs: dict[str, Node] = {}
        self.zero = self.constant(0.0)
        self.one = self.constant(1.0)

    def _append(self, kind: tuple[str, int, int]) -> Node:
        self._kinds.append(kind)
        return len(self._kinds) - 1

    def input(self, name: str) -> Node:
        """The node of an input."""
        return self._named[name]

    def constant(self, value: float) -> Node:
        """The node of a number."""
        value = float(value)
        node = self._constants.get(value)
        if node is None:
            node = self._append(("constant", len(self._constants), 0))
            self._constants[value] = node
            self._values[node] = value
        return node

    def apply(self, name: str, a: Node, b: Node = 0) -> Node:
        """The node of an operation on nodes."""
        if name in UNARY:
            b = 0
        elif name in ("add", "mul", "min", "max") and a > b:
            a, b = b, a
        key = (name, a, b)
        node = self._nodes.get(key)
        if node is None:
            kinds, values = self._kinds, self._values
            if a in values or b in values or "neg" in (kinds[a][0], kinds[b][0]):
                node = self._folded(name, a, b)
            if node is None:
                node = self._append(key)
            self._nodes[key] = node
        return node

    def _folded(self, name: str, a: Node, b: Node) -> Node | None:
        """The simpler node that an operation reduces to, if there is one."""
        x, y = self._values.get(a), self._values.get(b)
        if x is None and y is None:
            return self._without_signs(name, a, b)
        if x is not None and (name in UNARY or y is not None):
            function = OPERATIONS[name]
            with np.errstate(all="ignore"):
                value = float(function(x) if name in UNARY else function(x, y))
            return self.constant(value) if math.isfinite(value) else None
        if name == "add" and x == 0:
            return b
        if name in ("add", "sub") and y == 0:
            return a
        if name == "sub" and x == 0:
            return self.apply("neg", b)
        if name == "mul" and (x == 0 or y == 0):
            return self.zero
        if name == "mul" and x == 1:
            return b
        if name in ("mul", "div") and y == 1:
            return a
        if name == "mul" and -1 in (x, y):
            return self.apply("neg", b if x == -1 else a)
        if name == "div" and x == 0:
            return self.zero
        return self._without_signs(name, a, b)

    def _without_signs(self, name: str, a: Node, b: Node) -> Node | None:
        """Pull minus signs outwards, so that values that differ only in sign share a node."""
        kinds = self._kinds
        if kinds[a][0] != "neg" and (kinds[b][0] != "neg" or name in UNARY):
            return None
        p, q = self._negated(a), self._negated(b) if name not in UNARY else None
        first, second = a if p is None else p, b if q is None else q
        if name == "neg" and p is not None:
            return p
        if name == "abs" and p is not None:
            return self.apply("abs", p)
        if name in ("mul", "div"):
            node = self.apply(name, first, second)
            return node if p is not None and q is not None else self.apply("neg", node)
        if name == "add":
            if p is not None and q is not None:
                return self.apply("neg", self.apply("add", p, q))
            return self.apply("sub", a, q) if q is not None else self.apply("sub", b, first)
        if name == "sub" and q is not None:
            return self.apply("add", a, q)
        return None

    def _negated(self, node: Node) -> Node | None:
        name, inner, _ = self._kinds[node]
        return inner if name == "neg" else None

    def add(self, a: Node, b: Node) -> Node:
        """The node of a + b."""
        return self.apply("add", a, b)

    def sub(self, a: Node, b: Node) -> Node:
        """The node of a - b."""
        return self.apply("sub", a, b)

    def mul(self, a: Node, b: Node) -> Node:
        """The node of a b."""
        return self.apply("mul", a, b)

    def div(self, a: Node, b: Node) -> Node:
        """The node of a/b."""
        return self.apply("div", a, b)

    def sum(self, nodes: Iterable[Node]) -> Node:
        """Left-to-right sum; equal beginnings are shared."""
        rest = iter(nodes)
        total = next(rest, self.zero)
        for node in rest:
            total = self.apply("add", total, node)
        return total

    def signed_sum(self, terms: Iterable[tuple[int, Node]]) -> Node:
        """Sum with signs +1 and -1, positive terms first."""
        every = list(terms)
        total = self.sum(node for sign, node in every if sign > 0)
        for sign, node in every:
            if sign < 0:
                total = self.apply("sub", total, node)
        return total

    def square(self, a: Node) -> Node:
        """The node of a**2."""
        return self.mul(a, a)

    def is_zero(self, node: Node) -> bool:
        """Is this the constant 0?"""
        return node == self.zero

    def plan(self, outputs: Mapping[str, Node] | None = None) -> Plan:
        """Keep what the outputs (by default those of the graph) need.

        Numbers are given to inputs first, then to constants, then to operations.
        """
        outputs = self.outputs if outputs is None else outputs
        kinds = self._kinds
        inputs: list[Node] = []
        constants: list[Node] = []
        rest: list[Node] = []
        for node in self._needed(outputs.values()):
            name = kinds[node][0]
            of_kind = inputs if name == "input" else constants if name == "constant" else rest
            of_kind.append(node)
        number = [0] * len(kinds)
        for index, node in enumerate((*inputs, *constants, *rest)):
            number[node] = index
        operations = [
            (name, number[a], 0 if name in UNARY else number[b])
            for name, a, b in map(kinds.__getitem__, rest)
        ]
        return Plan(
            tuple(self._inputs[kinds[i][1]] for i in inputs),
            tuple(self._values[i] for i in constants),
            tuple(operations),
            {name: number[node] for name, node in outputs.items()},
        )

    def _needed(self, roots: Iterable[Node]) -> list[Node]:
        """The nodes that the roots need, each after its operands."""
        marks = bytearray(len(self._kinds))
        for node in roots:
            marks[node] = 1
        found = []
        node = marks.rfind(1)
        while node >= 0:
            found.append(node)
            name, a, b = self._kinds[node]
            if name not in ("input", "constant"):
                marks[a] = 1
                if name not in UNARY:
                    marks[b] = 1
            node = marks.rfind(1, 0, node)
        return found[::-1]
