"""Balances of a module as text in its author's names, with what flows in and out."""

from __future__ import annotations

from collections.abc import Iterator

from rulec.knowledge.module_type import ENDS, ModuleType, State
from rulec.knowledge.plant import Module
from rulec.language.expression import Expression, constant
from rulec.language.written import signed_sum
from rulec.passes.end_flows import KnownFlow
from rulec.passes.link import Network


def balances_text(network: Network, module: Module) -> Iterator[str]:
    """What a module stores and shows, one equation a line; nothing where it does neither.

    Equations are in the names of the module; what flows in or out stands as the sum of laws that it
    follows from.
    """
    kind = module.type
    for name in kind.observers:
        if any((known.module, known.name) == (module.name, name) for known in _taken(network)):
            yield f"{module.name}.{name} = {kind.observers[name].expression}   (a flow)"
    for state in kind.states.values():
        title = f"{module.name}.{state.name}"
        yield f"d {title}/dt = {state.rate}   ({', '.join(_bounds(state))})"
    for end in ENDS if kind.flows else ():
        if (module.name, end) in network.ends and end in kind.read:
            yield f"{module.name}.{end} = {flow_text(network, module.name, end)}"
    for name in _stood_on(kind):
        yield f"{module.name}.{name} = {kind.definitions[name].expression}"
    for reading in kind.readings.values():
        yield f"{module.name}.{reading.name} shows {reading.expression}"


def _taken(network: Network) -> Iterator[KnownFlow]:
    """Observers that count as laws of flows."""
    return (k for terms in network.ends.values() for _, k in terms if k.kind == "observer")


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
    """What flows at an end, as a sum of laws; ``0`` where nothing is connected."""
    terms = network.ends[module, end]
    return signed_sum((sign, f"{k.module}.{k.name}") for sign, k in terms)


def _stood_on(kind: ModuleType) -> list[str]:
    """Definitions that balances and readings stand on, and laws for what flows."""
    laws = [("definitions", end) for end in ENDS]
    used = {*ENDS} if kind.flows else set()
    for path, expression in kind.equations_at():
        if path[0] in ("states", "readings") or path[:2] in laws:
            used |= kind.names_through(expression)
    return [name for name in kind.definitions if name in used]
