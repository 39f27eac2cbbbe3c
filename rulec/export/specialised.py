"""The part of a plan that one module needs, with inputs that are known there put in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rulec_runtime.contract.plan import UNARY, Plan

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
