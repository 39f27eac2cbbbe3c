"""The observers of a plant with all faults undone, as functions of the degrees.

With the true degree of the true fault, all estimates agree again. This serves to test hypotheses,
and to fold known faults into the types.
"""

from collections.abc import Mapping

import sympy

from rulec.algebra.graph import Graph, Node
from rulec.algebra.recipe import lower
from rulec.passes.differentiate import GATHERED, TypeModel, degree_symbol
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
        for observer, fault in types[module.type.key].undone.liquid_slopes:
            found.setdefault(fault, []).append(f"{name}.{observer}")
    several = {i for i, o in found.items() if len({n.partition(".")[0] for n in o}) > 1}
    return {i: tuple(o) for i, o in found.items() if i in several}


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
        # Derivatives of readings by the degrees of their unlisted errors.
        self.errors: dict[str, dict[tuple[str, str], Node]] = {}
        self.tables = {name: self._symbol_nodes(name) for name in plant.modules}
        # Derivatives of readings by degrees, shared by all modules upstream.
        self._inner: dict[tuple[str, str], dict[str, Node]] = {}
        for name in plant.modules:
            self._gather(name)
        for name in plant.modules:
            self._observers(name)

    def _symbol_nodes(self, name: str) -> dict[sympy.Symbol, Node]:
        """Nodes of the own readings (with unlisted errors undone), parameters and degrees."""
        module, model, graph = self.network.plant.modules[name], self.models[name], self.graph
        nodes = {model.symbols[s]: graph.input(f"{name}.{s}") for s in module.type.signals}
        for parameter in module.parameters.values():
            nodes[model.symbols[parameter.name]] = graph.constant(parameter.value)
        for fault in (*model.faults, *model.unlisted):
            nodes[degree_symbol(fault.id)] = graph.input(f"x:{name}.{fault.id}")
        nodes |= {degree_symbol(i): graph.input(f"x:{i}") for i in self.liquid}
        slopes = model.undone.reading_slopes
        self.errors[name] = {key: lower(graph, slope, nodes) for key, slope in slopes.items()}
        readings = model.undone.readings
        return nodes | {model.symbols[s]: lower(graph, e, nodes) for s, e in readings.items()}

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
        graph, outputs = self.graph, self.graph.outputs
        nodes, undone = self.tables[name], self.models[name].undone
        for observer, expression in undone.observers.items():
            outputs[f"q:{name}.{observer}"] = lower(graph, expression, nodes)
        if self.liquid:
            for observer, expression in undone.in_liquid.items():
                outputs[f"ql:{name}.{observer}"] = lower(graph, expression, nodes)
            for (observer, fault), slope in undone.liquid_slopes.items():
                outputs[f"dql:{name}.{observer}:{fault}"] = lower(graph, slope, nodes)
        for (observer, fault), slope in undone.slopes.items():
            outputs[f"dq:{name}.{observer}:{name}.{fault}"] = lower(graph, slope, nodes)
        for (observer, signal), slope in undone.by_reading.items():
            outer = lower(graph, slope, nodes)
            for (reading, fault), inner in self.errors[name].items():
                if reading == signal:
                    key = f"dq:{name}.{observer}:{name}.{fault}"
                    outputs[key] = graph.mul(outer, inner)
        for (observer, gathered), slope in undone.gather_slopes.items():
            outer = lower(graph, slope, nodes)
            for m, s in self.network.gathers[name, gathered]:
                for fault, inner in self._slopes_of(m, s).items():
                    key = f"dq:{name}.{observer}:{m}.{fault}"
                    node = graph.mul(outer, inner)
                    outputs[key] = graph.add(outputs.get(key, graph.zero), node)

    def _slopes_of(self, module: str, signal: str) -> dict[str, Node]:
        """Slopes of a reading with all of its faults undone, by their degrees."""
        if (module, signal) not in self._inner:
            nodes, undone = self.tables[module], self.models[module].undone
            found = {
                fault: lower(self.graph, slope, nodes)
                for (reading, fault), slope in undone.signal_slopes.items()
                if reading == signal
            }
            for (reading, fault), inner in self.errors[module].items():
                if reading == signal:
                    outer = lower(self.graph, undone.signal_by_reading[signal], nodes)
                    found[fault] = self.graph.mul(outer, inner)
            self._inner[module, signal] = found
        return self._inner[module, signal]
