"""Module types of an adopted plant in a form that a file may have.

An observer depends on the present alone. So the flow of a module that depends on a new state, as
used in the balances of the plant, becomes a law of its inflow or outflow, as in modules that store.
The observer keeps the equation that holds once the state has settled at its start value. Readings
of other modules become sums over modules downstream."""

import ast
import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from rulec.effects.repair import AdoptRefused
from rulec.knowledge.module_type import ENDS, INFLOW, OUTFLOW, Definition, ModuleType
from rulec.knowledge.plant import Module
from rulec.language.diagnostics import Refused
from rulec.language.expression import GATHER, Expression, Rejected, name_node, over
from rulec.passes.amend import Amended, fresh, type_over
from rulec.passes.downstream import Downstream, Undefined
from rulec.passes.link import EndFlows, Network, law_of, link


def held_back(network: Network, types: Mapping[str, ModuleType]) -> dict[str, ModuleType]:
    """Amended types by module, none with an observer that depends on a state.

    Raises `AdoptRefused` if the flows of the plant would change.
    """
    result = dict(types)
    uncut = []
    for name, kind in types.items():
        if any(_moves(kind, o.expression) for o in kind.observers.values()):
            result[name] = _settled(kind, name)
            if not network.plant.modules[name].type.cuts:
                uncut.append(name)
    # Ends that may need a law; one too many would contradict that of a neighbour.
    choices = ((OUTFLOW,), (INFLOW,), (INFLOW, OUTFLOW))
    taken = any(_names_an_end(network, name) for name in uncut)
    for choice in itertools.product(choices, repeat=len(uncut)) if uncut and not taken else ():
        tried = dict(zip(uncut, choice, strict=True))
        made = {
            name: _with_laws(network, types, result, name, ends) for name, ends in tried.items()
        }
        if _flows_stay(network, {**result, **made}, uncut):
            return {**result, **made}
    if uncut:
        names = ", ".join(f"'{name}'" for name in uncut)
        raise AdoptRefused(
            f"what holds back the flow of {names} cannot be written into its type, as the flows "
            "around it would be others; give the type a law for its outflow"
        )
    return result


def _moves(kind: ModuleType, expression: Expression) -> bool:
    """Does an equation depend on a state?"""
    return not kind.names_through(expression).isdisjoint(kind.states)


def _settled(kind: ModuleType, module: str) -> ModuleType:
    """Observers with all states at their start values."""

    def still(expression: Expression) -> Expression:
        table: dict[str, ast.expr] = {}
        for name, _ in expression.names():
            if name in kind.states:
                table[name] = still(kind.states[name].start).tree
            elif name in kind.definitions and _moves(kind, kind.definitions[name].expression):
                table[name] = still(kind.definitions[name].expression).tree
        return over(expression, table)

    try:
        observers = {
            n: replace(o, expression=still(o.expression)) for n, o in kind.observers.items()
        }
    except Rejected as error:
        raise AdoptRefused(f"'{module}' cannot be written: {error.message}") from None
    return replace(kind, observers=observers)


def _with_laws(
    network: Network,
    types: Mapping[str, ModuleType],
    settled: Mapping[str, ModuleType],
    module: str,
    ends: Iterable[str],
) -> ModuleType:
    kind, law = settled[module], law_of(network.plant.modules[module].type)
    expression = types[module].observers[law].expression
    laws = {end: Definition(end, expression, f"{law}, held back") for end in ends}
    return replace(kind, definitions={**kind.definitions, **laws})


def _flows_stay(network: Network, types: Mapping[str, ModuleType], uncut: Iterable[str]) -> bool:
    """Do flows between the other modules remain the same sums of the same laws?"""
    modules = {n: replace(m, type=types[n]) for n, m in network.plant.modules.items()}
    try:
        ends = link(replace(network.plant, modules=modules)).ends
    except Refused:
        return False
    return set(_sums(network.ends, uncut)) == set(_sums(ends, uncut))


def _names_an_end(network: Network, module: str) -> bool:
    """Does this module use the name of an end for something else?"""
    kind = network.plant.modules[module].type
    names = {*kind.signals, *kind.parameters, *kind.definitions, *kind.states}
    return bool(names.intersection(ENDS))


def _sums(ends: EndFlows, uncut: Iterable[str]) -> Iterator[object]:
    """Flows at the ends of all other modules; the law of an opened module counts by its module."""
    for (module, end), terms in ends.items():
        if module not in uncut:
            flows = [(s, k.module, "" if k.module in uncut else k.name) for s, k in terms]
            yield module, end, tuple(sorted(flows))


class Gathering:
    """Readings of other modules as `downstream(name)`, with the names that types must provide."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._provides = {m.type.name: dict(m.type.provides) for m in self._modules}
        self._names: dict[tuple[str, str], str] = {}

    @property
    def _modules(self) -> list[Module]:
        return list(self._network.plant.modules.values())

    def name(self, module: str, source: str) -> str:
        """The name under which a module gathers this one signal; empty if it cannot."""
        if (module, source) not in self._names:
            self._names[module, source] = self._found(module, source)
        return self._names[module, source]

    def _found(self, module: str, source: str) -> str:
        owner, signal = source.split(".")
        if signal not in self._network.plant.modules[owner].type.signals:
            return ""
        kind = self._network.plant.modules[owner].type.name
        for name, provided in self._provides[kind].items():
            if provided == signal and self._sum(module, name) == ((owner, signal),):
                return name
        name = fresh(f"{signal}_{owner}", {n for own in self._provides.values() for n in own})
        self._provides[kind][name] = signal
        if self._sum(module, name) == ((owner, signal),):
            return name
        del self._provides[kind][name]
        return ""

    def _sum(self, module: str, name: str) -> tuple[tuple[str, str], ...]:
        """What `downstream(name)` sums with the types as they would be."""
        network = self._network
        modules = {m.name: replace(m, type=self._with_provides(m.type)) for m in self._modules}
        plant = replace(network.plant, modules=modules)
        try:
            return Downstream(plant, network.balances, network.graph).sum(module, name)
        except Undefined:
            return ()

    def _with_provides(self, kind: ModuleType) -> ModuleType:
        return replace(kind, provides=self._provides[kind.name])

    def written(self, module: str, amended: Amended) -> Amended:
        """An amended type without names of its own for readings of other modules."""
        table: dict[str, ast.expr] = {}
        for local, source in amended.outside.items():
            argument = name_node(self.name(module, source))
            table[local] = ast.Call(name_node(GATHER), [argument], [])
        kind = type_over(self._with_provides(amended.type), table)
        gathers = {name for e in kind.equations() for name, _ in e.gathered()}
        return replace(amended, type=replace(kind, gathers=tuple(sorted(gathers))), outside={})
