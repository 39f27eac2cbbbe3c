"""The observers of a plant with all faults undone, as functions of the degrees.

With the true degree of the true fault put in, all estimates agree again: that is how a hypothesis
is tested, and how a known fault is folded into the types.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy

from rulec.algebra.graph import Graph, Node
from rulec.passes.differentiate import GATHERED, TypeModel, degree_symbol
from rulec.passes.link import Network

Types = Mapping[str, TypeModel]
"""Models by key of the module type."""


def undo_graph(network: Network, types: Types, faults: tuple[str, ...]) -> Graph:
    """Build the graph; outputs are ``q:<observer>`` and ``dq:<observer>:<fault>``."""
    plant = network.plant
    signals = [f"{m.name}.{s}" for m in plant.modules.values() for s in m.type.signals]
    graph = Graph([*signals, *(f"x:{fault}" for fault in faults)])
    tables = {name: _symbol_nodes(graph, types, network, name) for name in plant.modules}
    for name in plant.modules:
        _gather(graph, types, network, name, tables)
    for name in plant.modules:
        _observers(graph, types, network, name, tables)
    return graph


def _model(types: Types, network: Network, module: str) -> TypeModel:
    return types[network.plant.modules[module].type.key]


def _symbol_nodes(
    graph: Graph, types: Types, network: Network, name: str
) -> dict[sympy.Symbol, Node]:
    """Nodes of the own signals, parameters and degrees of a module."""
    module, model = network.plant.modules[name], _model(types, network, name)
    nodes = {model.symbols[s]: graph.input(f"{name}.{s}") for s in module.type.signals}
    for parameter in module.parameters.values():
        nodes[model.symbols[parameter.name]] = graph.constant(parameter.value)
    for fault in model.faults:
        nodes[degree_symbol(fault.id)] = graph.input(f"x:{name}.{fault.id}")
    return nodes


def _gather(
    graph: Graph,
    types: Types,
    network: Network,
    name: str,
    tables: Mapping[str, dict[sympy.Symbol, Node]],
) -> None:
    """Sums over modules downstream, of their readings with faults undone."""
    model = _model(types, network, name)
    for gathered in model.type.gathers:
        parts = [
            graph.lower(_model(types, network, m).undone.signals[s], tables[m])
            for m, s in network.gathers[name, gathered]
        ]
        tables[name][model.symbols[GATHERED + gathered]] = graph.sum(parts)


def _observers(
    graph: Graph,
    types: Types,
    network: Network,
    name: str,
    tables: Mapping[str, dict[sympy.Symbol, Node]],
) -> None:
    nodes, undone = tables[name], _model(types, network, name).undone
    for observer, expression in undone.observers.items():
        graph.outputs[f"q:{name}.{observer}"] = graph.lower(expression, nodes)
    for (observer, fault), slope in undone.slopes.items():
        graph.outputs[f"dq:{name}.{observer}:{name}.{fault}"] = graph.lower(slope, nodes)
    for (observer, gathered), slope in undone.gather_slopes.items():
        outer = graph.lower(slope, nodes)
        for m, s in network.gathers[name, gathered]:
            for (signal, fault), inner in _model(types, network, m).undone.signal_slopes.items():
                if signal == s:
                    output = f"dq:{name}.{observer}:{m}.{fault}"
                    node = graph.mul(outer, graph.lower(inner, tables[m]))
                    graph.outputs[output] = graph.add(graph.outputs.get(output, graph.zero), node)
