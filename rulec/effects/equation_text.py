"""Equations of amended module types, and balances of modules, as text."""

import ast
from collections.abc import Iterator

from rulec.knowledge.module_type import ENDS, State
from rulec.knowledge.plant import Module
from rulec.language.expression import Expression, constant, name_node, replaced, text_of
from rulec.language.write_yaml import signed_sum
from rulec.passes.amend import Amended
from rulec.passes.link import Network


def equation_of(amended: Amended, place: tuple[str, str]) -> str:
    """The equation of a place in local names and the definitions that its author wrote."""
    kind, name = place
    own = amended.type
    if kind == "observer":
        left, right = name, own.observers[name].expression
    elif kind == "balance":
        left, right = f"d{name}/dt", own.states[name].rate
    elif kind == "reading":
        left, right = name, own.readings[name].expression
    elif kind == "definition" or name in own.definitions:
        left, right = name, own.definitions[name].expression
    elif name in amended.corrected:
        left, right = f"true {name}", own.definitions[amended.corrected[name]].expression
    else:
        return f"{name} = {name}"
    return f"{left} = {_written_out(amended, right)}"


def _written_out(amended: Amended, expression: Expression) -> str:
    # Such as B.T, which no equation of the language could name.
    outside = {name: name_node(source) for name, source in amended.outside.items()}

    def tree(inner: Expression) -> ast.expr:
        table: dict[str, ast.expr] = dict(outside)
        for name, _ in inner.names():
            if name in amended.made:
                table[name] = tree(amended.type.definitions[name].expression)
        return replaced(inner.tree, table)

    return text_of(tree(expression))


def balances_text(network: Network, module: Module) -> Iterator[str]:
    """The balances, flows and readings of a module, one equation a line; none without balances.

    Equations use the names of the module. A flow at an end is a sum of laws.
    """
    kind = module.type
    laws = [k for terms in network.ends.values() for _, k in terms if k.kind == "observer"]
    for name in kind.observers:
        if any((law.module, law.name) == (module.name, name) for law in laws):
            yield f"{module.name}.{name} = {kind.observers[name].expression}   (a flow)"
    for state in kind.states.values():
        title = f"{module.name}.{state.name}"
        yield f"d {title}/dt = {state.rate}   ({', '.join(_bounds(state))})"
    for end in ENDS if kind.flows else ():
        if (module.name, end) in network.ends and end in kind.read:
            yield f"{module.name}.{end} = {flow_text(network, module.name, end)}"
    used = kind.reached("states", "readings") | ({*ENDS} if kind.flows else set())
    for definition in kind.definitions.values():
        if definition.name in used:
            yield f"{module.name}.{definition.name} = {definition.expression}"
    for reading in kind.readings.values():
        yield f"{module.name}.{reading.name} shows {reading.expression}"


def _bounds(state: State) -> Iterator[str]:
    yield f"from {_value(state, state.start)}"
    if state.low is not None:
        yield f"not below {_value(state, state.low)}"
    if state.high is not None:
        yield f"not above {_value(state, state.high)}"
    if state.after is not None:
        yield f"not as a lag, but all of it {state.after} s later"


def _value(state: State, expression: Expression) -> str:
    """An equation, or a number in the unit of the state."""
    number = constant(expression, {})
    return (
        str(expression) if number is None else f"{state.unit.from_si(number):g} {state.unit.text}"
    )


def flow_text(network: Network, module: str, end: str) -> str:
    """The flow at an end as a sum of laws; ``0`` if nothing is connected."""
    return signed_sum((sign, f"{k.module}.{k.name}") for sign, k in network.ends[module, end])
