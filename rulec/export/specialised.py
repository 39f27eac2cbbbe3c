"""The part of a plan that one module needs, with known inputs substituted.

Modules know only listed faults: a controller has no room for more slopes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rulec_runtime.contract.plan import UNARY, Plan
from rulec_runtime.contract.ruleset import Ruleset

from rulec.algebra.graph import Graph, Node


def is_output_of(output: str, observers: set[str], kinds: tuple[str, ...]) -> bool:
    """Whether an output, such as ``q:A.pump``, is of one of the kinds and observers."""
    kind, _, rest = output.partition(":")
    return kind in kinds and rest.partition(":")[0] in observers


def put_into(
    graph: Graph, plan: Plan, outputs: Iterable[str], known: Mapping[str, float]
) -> dict[str, Node]:
    """Build outputs of a plan in a graph; inputs in `known` become constants.

    Returns the node of each output. Nodes that the graph already holds are shared.
    """
    part = plan.select(tuple(outputs)).narrowed()
    nodes = [graph.constant(known[n]) if n in known else graph.input(n) for n in part.inputs]
    nodes += [graph.constant(value) for value in part.constants]
    for name, a, b in part.operations:
        nodes.append(graph.apply(name, nodes[a], 0 if name in UNARY else nodes[b]))
    return {name: nodes[i] for name, i in part.outputs.items()}


def listed_undo(ruleset: Ruleset) -> Plan:
    """The plan that undoes only listed faults; the degrees of the others are 0."""
    undo, unlisted = ruleset.undo, {f.id for f in ruleset.unlisted}
    if not unlisted:
        return undo
    outputs = [name for name in undo.outputs if name.split(":", 2)[-1] not in unlisted]
    none = {name: 0.0 for name in undo.inputs if name.removeprefix("x:") in unlisted}
    graph = Graph(dict.fromkeys(name for name in undo.inputs if name not in none))
    graph.outputs.update(put_into(graph, undo, outputs, none))
    return graph.plan()
