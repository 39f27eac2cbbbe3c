"""The part of a plan that one module needs, with inputs that are known there put in.

Modules know listed faults alone: more slopes would be more code than a controller has room for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rulec_runtime.contract.plan import UNARY, Plan
from rulec_runtime.contract.ruleset import Ruleset

from rulec.algebra.graph import Graph, Node


def graph_of(inputs: Iterable[str]) -> Graph:
    """An empty graph over inputs."""
    return Graph(dict.fromkeys(inputs))


def put_into(
    graph: Graph, plan: Plan, outputs: Iterable[str], known: Mapping[str, float]
) -> dict[str, Node]:
    """Build outputs of a plan in a graph; inputs in `known` become constants.

    Returns the node of each output. What the graph holds already is shared.
    """
    part = plan.select(tuple(outputs)).narrowed()
    nodes = [graph.constant(known[n]) if n in known else graph.input(n) for n in part.inputs]
    nodes += [graph.constant(value) for value in part.constants]
    for name, a, b in part.operations:
        nodes.append(graph.apply(name, nodes[a], 0 if name in UNARY else nodes[b]))
    return {name: nodes[i] for name, i in part.outputs.items()}


def listed_undo(ruleset: Ruleset) -> Plan:
    """The plan that undoes listed faults alone: the others are at no degree."""
    undo, unlisted = ruleset.undo, {f.id for f in ruleset.unlisted}
    if not unlisted:
        return undo
    outputs = [name for name in undo.outputs if name.split(":", 2)[-1] not in unlisted]
    none = {name: 0.0 for name in undo.inputs if name.removeprefix("x:") in unlisted}
    graph = graph_of(name for name in undo.inputs if name not in none)
    graph.outputs.update(put_into(graph, undo, outputs, none))
    return graph.plan()
