"""Run exported structured text: parsed by the grammar of blark, its tree evaluated."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from blark import transform as st
from blark.parse import parse_source_code
from rulec_runtime.contract.plan import OPERATIONS

from rulec.export.program import LOGIC, Value

OPERATORS = {"+": "add", "-": "sub", "*": "mul", "/": "div", ">=": "ge", ">": "gt", "<=": "le"}
OPERATORS |= {"AND": "and"}
FUNCTIONS = {"SQRT": "sqrt", "EXP": "exp", "LN": "log", "ABS": "abs", "EXPT": "pow"}
FUNCTIONS |= {"MIN": "min", "MAX": "max"}


class Block:
    def __init__(self, block: st.FunctionBlock) -> None:
        self.name = str(block.name)
        kinds = {st.InputDeclarations: "inputs", st.OutputDeclarations: "outputs"}
        declared: dict[str, dict[str, str]] = {"inputs": {}, "outputs": {}, "own": {}}
        self.constants: dict[str, Value] = {}
        for part in block.declarations:
            table = declared[kinds.get(type(part), "own")]
            for item in part.items:
                for variable in item.variables:
                    name = str(variable.name).lower()
                    assert all(name not in known for known in declared.values()), name
                    table[name] = str(item.init.spec)
                    if (value := item.init.value) is not None:
                        self.constants[name] = _value(value, {})
        self.declared = declared
        self.statements = block.body.statements

    def run(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Values of all outputs, by name in lower case."""
        known = {name.lower(): value for name, value in values.items()} | self.constants
        assert self.declared["inputs"].keys() <= known.keys()
        with np.errstate(all="ignore"):
            for statement in self.statements:
                (target,) = statement.variables
                known[str(target.name).lower()] = _value(statement.expression, known)
        return {name: known[name] for name in self.declared["outputs"]}


def parsed(text: str) -> dict[str, Block]:
    """Function blocks of a source text, by name; it must keep to the grammar."""
    result = parse_source_code(text)
    assert result.exception is None, result.exception
    return {block.name: block for block in map(Block, result.transform().items)}


def _value(tree: Any, known: Mapping[str, Value]) -> Value:
    match tree:
        case st.Real() | st.Integer():
            return float(str(tree.value))
        case st.SimpleVariable():
            return known[str(tree.name).lower()]
        case st.ParenthesizedExpression():
            return _value(tree.expr, known)
        case st.UnaryOperation():
            function = np.logical_not if str(tree.op) == "NOT" else np.negative
            return function(_value(tree.expr, known))
        case st.BinaryOperation():
            name = OPERATORS[str(tree.op)]
            function = LOGIC.get(name) or OPERATIONS[name]
            return function(_value(tree.left, known), _value(tree.right, known))
        case st.FunctionCall():
            arguments = [_value(p.value, known) for p in tree.parameters]
            name = str(tree.name.name)
            if name == "SEL":
                condition, otherwise, then = arguments
                return np.where(condition, then, otherwise)
            return OPERATIONS[FUNCTIONS[name]](*arguments)
    raise AssertionError(f"not expected in our code: {tree!r}")
