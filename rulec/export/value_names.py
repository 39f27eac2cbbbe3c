"""The part of a plan that one module needs, and names for its values.

A plan has only numbers. Constants are named after the parameters that they equal. Parts of an
equation are named as in the equation: plan and equation are walked together from the top, and where
the equation has a name, the plan has a number. Modules know only listed faults: a controller has no
room for more slopes.
"""

import ast
from collections.abc import Iterable, Iterator, Mapping
from math import isclose

from rulec_runtime.contract.plan import UNARY, Plan
from rulec_runtime.contract.ruleset import ObserverSpec, ParameterSpec, Ruleset
from rulec_runtime.recordings.reading_unit import parse_unit

from rulec.algebra.graph import Graph
from rulec.export import limits
from rulec.export.identifiers import Identifiers
from rulec.export.program import Parameter

OPERATORS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}


def named_constants(
    ruleset: Ruleset, module: str, constants: Iterable[float], names: Identifiers
) -> tuple[Parameter, ...]:
    """Those constants that equal exactly one parameter of the module."""
    parameters = list(_values(ruleset, module))
    found = []
    for value in constants:
        same = [p for p, si in parameters if isclose(si, value, rel_tol=limits.SAME_CONSTANT)]
        if len(same) == 1 and abs(value) != 1.0 and value != 0.0:
            (own,) = same
            unit = "" if own.unit == "1" else f" {own.unit}"
            text = f"{own.value:.6g}{unit}, {own.origin}"
            found.append(Parameter(names.new(own.id.partition(".")[2]), value, text))
    return tuple(found)


def _values(ruleset: Ruleset, module: str) -> Iterator[tuple[ParameterSpec, float]]:
    """Parameters of a module with their values in SI."""
    for parameter in ruleset.parameters:
        if parameter.id.startswith(f"{module}."):
            unit = parse_unit(parameter.unit, ruleset.units)
            factor, offset = (1.0, 0.0) if unit is None else (unit.factor, unit.offset)
            yield parameter, parameter.value * factor + offset


def hints_of(plan: Plan, observer: ObserverSpec, given: Mapping[int, str]) -> dict[int, str]:
    """Names by number of value; `given` are names of readings and constants in the equation."""
    found: dict[int, str] = {}
    try:
        tree = ast.parse(observer.equation.partition(" = ")[2], mode="eval").body
    except (SyntaxError, RecursionError, MemoryError):
        return found
    _walk(plan, tree, plan.outputs[f"q:{observer.id}"], given, found)
    return found


def _walk(
    plan: Plan, tree: ast.expr, number: int, given: Mapping[int, str], found: dict[int, str]
) -> bool:
    """Enter names below a value; False if equation and plan have different forms."""
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


def is_output_of(output: str, observers: set[str], kinds: tuple[str, ...]) -> bool:
    """Whether an output, such as ``q:A.pump``, is of one of the kinds and observers."""
    kind, _, rest = output.partition(":")
    return kind in kinds and rest.partition(":")[0] in observers


def put_into(graph: Graph, plan: Plan, outputs: Iterable[str], fixed: Mapping[str, float]) -> None:
    """Add outputs of a plan to a graph, whose nodes are shared; inputs in `fixed` become
    constants."""
    part = plan.select(tuple(outputs)).narrowed()
    nodes = [graph.constant(fixed[n]) if n in fixed else graph.input(n) for n in part.inputs]
    nodes += [graph.constant(value) for value in part.constants]
    for name, a, b in part.operations:
        nodes.append(graph.apply(name, nodes[a], 0 if name in UNARY else nodes[b]))
    graph.outputs.update({name: nodes[i] for name, i in part.outputs.items()})


def listed_undo(ruleset: Ruleset) -> Plan:
    """The plan that undoes only listed faults; the degrees of the others are 0."""
    undo, unlisted = ruleset.undo, {f.id for f in ruleset.unlisted}
    if not unlisted:
        return undo
    outputs = [name for name in undo.outputs if name.split(":", 2)[-1] not in unlisted]
    none = {name: 0.0 for name in undo.inputs if name.removeprefix("x:") in unlisted}
    graph = Graph(dict.fromkeys(name for name in undo.inputs if name not in none))
    put_into(graph, undo, outputs, none)
    return graph.plan()
