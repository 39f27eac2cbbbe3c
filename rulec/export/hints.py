"""Names that an equation has for parts of itself, found again in the plan.

The plan knows no names. Its first operations are those of the equation, so both are walked
together from the top: where the equation has a name, the plan has a number.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping

from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import ObserverSpec

OPERATORS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}


def hints_of(plan: Plan, observer: ObserverSpec, given: Mapping[int, str]) -> dict[int, str]:
    """Names by number of value; `given` are names of readings and constants in the equation."""
    text = observer.equation.partition(" = ")[2]
    found: dict[int, str] = {}
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, RecursionError, MemoryError):
        return found
    _walk(plan, tree, plan.outputs[f"q:{observer.id}"], given, found)
    return found


def _walk(
    plan: Plan, tree: ast.expr, number: int, given: Mapping[int, str], found: dict[int, str]
) -> bool:
    """Enter names below a value; False where equation and plan are not of one form."""
    if isinstance(tree, ast.Name):
        if number >= plan.first_operation:
            found[number] = tree.id
            return True
        return given.get(number) == tree.id
    if number < plan.first_operation:
        return False
    name, a, b = plan.operations[number - plan.first_operation]
    match tree:
        case ast.Call(func=ast.Name(id=function), args=[argument]) if function == name:
            return _walk(plan, argument, a, given, found)
        case ast.BinOp(left=left, op=operator, right=right) if (
            OPERATORS.get(type(operator)) == name
        ):
            orders = [(a, b), (b, a)] if name in ("add", "mul") else [(a, b)]
            for first, second in orders:
                trial = dict(found)
                if _walk(plan, left, first, given, trial) and _walk(
                    plan, right, second, given, trial
                ):
                    found.update(trial)
                    return True
    return False
