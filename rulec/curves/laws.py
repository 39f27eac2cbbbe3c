"""Laws of a module type as functions of its signals and parameters."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.contract.plan import Plan

from rulec.algebra.graph import Graph, Node
from rulec.knowledge.dimensions_of import dimensions_of
from rulec.knowledge.module_type import ModuleType
from rulec.language.expression import Expression
from rulec.language.units import VOLUME_FLOW, Dimension
from rulec.passes.lower import lower_tree


@dataclass(frozen=True)
class Law:
    """A definition or an observer that predicts a column.

    `reads` are its signals, `free` the parameters that a fit may change.
    """

    group: str
    name: str
    dimension: Dimension
    reads: frozenset[str]
    free: tuple[str, ...]


def laws_of(kind: ModuleType) -> list[Law]:
    """Laws that depend on signals and parameters alone, definitions first."""
    dimensions = dimensions_of(kind)
    parts = {
        **{("definitions", d.name): d.expression for d in kind.definitions.values()},
        **{("observers", o.name): o.expression for o in kind.observers.values()},
    }
    found = []
    for (group, name), expression in parts.items():
        is_law = group != "definitions" or (group, name) in kind.laws()
        names = kind.names_through(expression)
        equations = list(kind.with_definitions(expression))
        asks = any(next(e.gathered(), next(e.properties(), None)) for e in equations)
        free = tuple(p.name for p in kind.parameters.values() if p.fit and p.name in names)
        if is_law and free and not asks and not names & kind.states.keys():
            gives = dimensions[name] if group == "definitions" else VOLUME_FLOW
            reads = frozenset(names & kind.signals.keys())
            found.append(Law(group, name, gives, reads, free))
    return found


def plan_of(kind: ModuleType, laws: list[Law]) -> Plan:
    """A plan with the laws as outputs and signals and parameters as inputs, by name; all SI."""
    graph = Graph((*kind.signals, *kind.parameters))
    names = _Names(graph, kind, {})
    for law in laws:
        parts = kind.definitions if law.group == "definitions" else kind.observers
        graph.outputs[law.name] = names.node(parts[law.name].expression)
    return graph.plan()


@dataclass(frozen=True)
class _Names:
    """Names of a module type as nodes of a graph, with definitions expanded."""

    graph: Graph
    kind: ModuleType
    known: dict[str, Node]

    def node(self, expression: Expression) -> Node:
        return lower_tree(self.graph, expression.tree, self)

    def value(self, name: str) -> Node:
        if name not in self.kind.definitions:
            return self.graph.input(name)
        if name not in self.known:
            self.known[name] = self.node(self.kind.definitions[name].expression)
        return self.known[name]

    def gathered(self, name: str) -> Node:
        raise AssertionError(f"a law that reads {name} of others is left out")

    def property(self, name: str, temperature: Node) -> Node:
        raise AssertionError(f"a law that asks for {name} of a fluid is left out")
