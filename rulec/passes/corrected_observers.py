"""The observers of a plant with all faults undone, as functions of the degrees.

With the true degree of the true fault, all estimates agree again. This serves to test hypotheses,
and to fold known faults into the types.
"""

from collections.abc import Iterable, Mapping
from itertools import chain

import sympy

from rulec.algebra.derivative import derivative, symbols_in
from rulec.algebra.graph import Graph, Node
from rulec.algebra.recipe import lower
from rulec.passes.differentiate import GATHERED, TypeModel, degree_symbol, liquid_ids
from rulec.passes.link import Network

Types = Mapping[str, TypeModel]
"""Models by key of the module type."""


def undo_graph(network: Network, types: Types, faults: tuple[str, ...]) -> Graph:
    """Build the graph; outputs are ``q:<observer>`` and ``dq:<observer>:<fault>``.

    Faults include unlisted errors. If a change of the liquid moves an observer, ``ql:`` and
    ``dql:`` are the same with that change undone as well; at degree 0, ``ql:`` equals ``q:``.
    """
    return _Undo(network, types, faults).graph


def liquid_affects(network: Network, types: Types) -> dict[str, tuple[str, ...]]:
    """Observers that each fault of the liquid makes wrong, if they are of several modules.

    If only one module is affected, the faults of that module cover it.
    """
    found: dict[str, list[str]] = {}
    for name, module in network.plant.modules.items():
        for observer, expression in types[module.type.key].undone.in_liquid.items():
            for fault in liquid_ids(network.plant.knowledge):
                if degree_symbol(fault) in symbols_in(expression):
                    found.setdefault(fault, []).append(f"{name}.{observer}")
    several = {i for i, o in found.items() if len({n.partition(".")[0] for n in o}) > 1}
    return {i: tuple(o) for i, o in found.items() if i in several}


Slopes = Iterable[tuple[str, Node]]
"""Slopes of a value by the degrees of faults, by full ids of these."""

Ways = Iterable[tuple[sympy.Symbol, Slopes]]
"""Variables of a module that depend on degrees, each with its slopes."""


class _Undo:
    """Builds the graph; `tables` holds, per module, the nodes of its symbols."""

    def __init__(self, network: Network, types: Types, faults: tuple[str, ...]) -> None:
        plant = network.plant
        self.network = network
        self.models = {name: types[module.type.key] for name, module in plant.modules.items()}
        others = (f"{m}.{f.id}" for m, model in self.models.items() for f in model.unlisted)
        self.liquid = liquid_affects(network, types)
        every = (*faults, *others, *self.liquid)
        self.graph = Graph([*plant.signals, *dict.fromkeys(f"x:{fault}" for fault in every)])
        self.tables: dict[str, dict[sympy.Symbol, Node]] = {}
        # Slopes of readings by the degrees of their unlisted errors.
        self.errors: dict[str, dict[sympy.Symbol, Slopes]] = {}
        # Slopes of readings with all faults undone, shared by all modules upstream.
        self._inner: dict[tuple[str, str], Slopes] = {}
        for name in plant.modules:
            self._own_symbols(name)
        for name in plant.modules:
            self._gather(name)
        for name in plant.modules:
            self._observers(name)

    def _own_symbols(self, name: str) -> None:
        """Add parameters, degrees, and the own readings (with unlisted errors undone)."""
        module, model, graph = self.network.plant.modules[name], self.models[name], self.graph
        nodes = {model.symbols[s]: graph.input(f"{name}.{s}") for s in module.type.signals}
        for parameter in module.parameters.values():
            nodes[model.symbols[parameter.name]] = graph.constant(parameter.value)
        for fault in (*model.faults, *model.unlisted):
            nodes[degree_symbol(fault.id)] = graph.input(f"x:{name}.{fault.id}")
        nodes |= {degree_symbol(i): graph.input(f"x:{i}") for i in self.liquid}
        self.tables[name] = nodes
        read = {model.symbols[s]: e for s, e in model.undone.readings.items()}
        further = [f.id for f in model.unlisted]
        self.errors[name] = {
            s: [*self._slopes(name, e, self._degrees(f"{name}.", further))] for s, e in read.items()
        }
        self.tables[name] = nodes | {s: lower(graph, e, nodes) for s, e in read.items()}

    def _gather(self, name: str) -> None:
        """Add downstream sums of readings with faults undone."""
        model = self.models[name]
        for gathered in model.type.gathers:
            parts = [
                lower(self.graph, self.models[m].undone.signals[s], self.tables[m])
                for m, s in self.network.gathers[name, gathered]
            ]
            self.tables[name][model.symbols[GATHERED + gathered]] = self.graph.sum(parts)

    def _observers(self, name: str) -> None:
        """Add observers with faults undone, and their slopes by the degrees that affect them."""
        graph, outputs, undone = self.graph, self.graph.outputs, self.models[name].undone
        for observer, expression in undone.observers.items():
            outputs[f"q:{name}.{observer}"] = lower(graph, expression, self.tables[name])
        if self.liquid:
            changes = liquid_ids(self.network.plant.knowledge)
            for observer, expression in undone.in_liquid.items():
                outputs[f"ql:{name}.{observer}"] = lower(graph, expression, self.tables[name])
            for observer, expression in undone.in_liquid.items():
                for fault, node in self._slopes(name, expression, self._degrees("", changes)):
                    outputs[f"dql:{name}.{observer}:{fault}"] = node
        for ways in (self._by_degrees, self._by_errors, self._by_gathered):
            for observer, expression in undone.observers.items():
                for fault, node in self._slopes(name, expression, ways(name)):
                    key = f"dq:{name}.{observer}:{fault}"
                    outputs[key] = graph.add(outputs.get(key, graph.zero), node)

    def _slopes(self, name: str, expression: sympy.Expr, ways: Ways) -> Slopes:
        """Slopes of an expression of a module by degrees, along the ways there (chain rule)."""
        used = symbols_in(expression)
        for variable, slopes in ways:
            if variable in used:
                slope = derivative(expression, variable)
                outer = lower(self.graph, slope, self.tables[name])
                for fault, inner in slopes:
                    yield fault, self.graph.mul(outer, inner)

    def _degrees(self, module: str, faults: Iterable[str]) -> Ways:
        """Degrees themselves, by ids of faults in a module; of the liquid, without one."""
        for fault in faults:
            yield degree_symbol(fault), [(f"{module}{fault}", self.graph.one)]

    def _by_degrees(self, name: str) -> Ways:
        return self._degrees(f"{name}.", (f.id for f in self.models[name].faults))

    def _by_errors(self, name: str) -> Ways:
        return self.errors[name].items()

    def _by_gathered(self, name: str) -> Ways:
        for gathered in self.models[name].type.gathers:
            parts = (self._of_signal(m, s) for m, s in self.network.gathers[name, gathered])
            yield self.models[name].symbols[GATHERED + gathered], chain.from_iterable(parts)

    def _of_signal(self, module: str, signal: str) -> Slopes:
        """Slopes of a reading with all of its faults undone."""
        if (module, signal) not in self._inner:
            expression = self.models[module].undone.signals[signal]
            ways = (*self._by_degrees(module), *self._by_errors(module))
            self._inner[module, signal] = [*self._slopes(module, expression, ways)]
        return self._inner[module, signal]
