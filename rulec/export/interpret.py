"""Interpret a routine: the reference for any printed code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import OPERATIONS

from rulec.export.program import Apply, Expression, Name, Number, Routine

Value = Any
"""A number or truth value, or an array of them."""

LOGIC: Mapping[str, Callable[..., Value]] = {
    "ge": np.greater_equal,
    "gt": np.greater,
    "le": np.less_equal,
    "and": np.logical_and,
    "not": np.logical_not,
    "select": np.where,
}


def run(routine: Routine, values: Mapping[str, Value]) -> dict[str, Value]:
    """Outputs of a routine by name; `values` are those of its inputs, or arrays of shape (n,), in
    the units of the inputs."""
    known: dict[str, Value] = {v.name: values[v.name] for v in routine.inputs}
    known |= {p.name: p.value for p in routine.parameters}
    # Readings are compared before the routine knows that they are not numbers.
    with np.errstate(all="ignore"):
        for statement in routine.statements:
            known[statement.name] = evaluated(statement.expression, known)
    return {v.name: known[v.name] for v in routine.outputs}


def evaluated(expression: Expression, known: Mapping[str, Value]) -> Value:
    """Value of an expression."""
    match expression:
        case Number(value):
            return value
        case Name(text):
            return known[text]
        case Apply(operation, operands):
            function = LOGIC.get(operation) or OPERATIONS[operation]
            return function(*(evaluated(e, known) for e in operands))
