"""Flows by continuity: which flows the junction balances fix, and as which sums.

A plant is a graph: junctions are nodes, modules are edges along their flow, and everything open
ends at one more node, the surroundings. Flows that balance are circulations of this graph. Two
facts of graph theory do the work: a flow is fixed by known flows exactly if its edge is a bridge
once the known edges are taken out, and it is then the net known flow into one side of the bridge.
So all factors are +1 or -1 and the effort is linear in the graph, whatever splits and loops it has.

Source: incidence matrices are totally unimodular (Poincare 1900); bridges after Tarjan (1974).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

import networkx as nx

Terms = dict[str, int]
"""A signed sum of modules' flows."""

SURROUNDINGS = -1
"""The node at which all open ends meet. Its balance follows from the others."""


@dataclass(frozen=True)
class Balance:
    """Flows of `outlets` modules together become the flows of `inlets` modules."""

    outlets: tuple[str, ...]
    inlets: tuple[str, ...]


@dataclass(frozen=True)
class FixedFlow:
    """The flow of a module as sum of others; `upstream`: of what flows in on its inlet side."""

    terms: Terms
    upstream: bool


@dataclass(frozen=True)
class FlowGraph:
    """Junctions are numbered as the balances are; `ends` gives inlet and outlet node of modules."""

    ends: Mapping[str, tuple[int, int]]

    @staticmethod
    def of(balances: Sequence[Balance], modules: Iterable[str] = ()) -> FlowGraph:
        """The graph of all modules that touch a junction, and of `modules`."""
        inlet = {m: i for i, b in enumerate(balances) for m in b.inlets}
        outlet = {m: i for i, b in enumerate(balances) for m in b.outlets}
        names = dict.fromkeys([*modules, *outlet, *inlet])
        ends = {m: (inlet.get(m, SURROUNDINGS), outlet.get(m, SURROUNDINGS)) for m in names}
        return FlowGraph(ends)

    def places(self, measured: Iterable[str]) -> dict[int, int]:
        """Junctions that modules of unknown flow join, under one number each.

        At every place but the surroundings the measured flows balance.
        """
        parts = nx.connected_components(self._without(set(measured)))
        number = {node: min(part) for part in parts for node in part}
        return dict(sorted(number.items()))

    def _without(self, known: Set[str]) -> nx.MultiGraph:
        """Junctions as nodes, modules of unknown flow as edges between them."""
        unknown = nx.MultiGraph()
        unknown.add_nodes_from([SURROUNDINGS, *(n for pair in self.ends.values() for n in pair)])
        for name, (tail, head) in self.ends.items():
            if name not in known and tail != head:
                unknown.add_edge(tail, head, key=name)
        return unknown

    def measured_balances(self, measured: Iterable[str]) -> dict[int, dict[str, int]]:
        """The balances of known flows: per place the modules that enter (+1) and leave (-1)."""
        measured = list(measured)
        place, result = self.places(measured), dict[int, dict[str, int]]()
        for name in measured:
            tail, head = (place[node] for node in self.ends[name])
            if tail != head:
                result.setdefault(head, {})[name] = 1
                result.setdefault(tail, {})[name] = -1
        result.pop(place[SURROUNDINGS], None)
        return dict(sorted(result.items()))


def flows_by_continuity(graph: FlowGraph, known: Iterable[str]) -> dict[str, FixedFlow]:
    """Flows of further modules that those of `known` fix.

    A sum of what flows in upstream is preferred; modules are left out whose flow is unknown, or
    zero whatever the known ones are.

    >>> graph = FlowGraph.of([Balance(("A", "B"), ("C",))])
    >>> flows_by_continuity(graph, ["A", "B"])
    {'C': FixedFlow(terms={'A': 1, 'B': 1}, upstream=True)}
    """
    given = set(known)
    cuts = _Cuts(graph, given)
    return {name: flow for name in graph.ends if name not in given and (flow := cuts.flow(name))}


def without_flow(graph: FlowGraph) -> list[str]:
    """Modules in which nothing can flow, as they are the only link between two closed parts."""
    cuts = _Cuts(graph, set())
    return [name for name in graph.ends if name in cuts.below]


class _Cuts:
    """Modules that alone join two parts by an unknown flow, and what is known to enter the parts.

    `below` gives by such a module (a bridge) the node at its far end from the root of its part.
    """

    def __init__(self, graph: FlowGraph, known: Set[str]) -> None:
        self._ends = graph.ends
        unknown = graph._without(known)
        enters: dict[int, Terms] = {node: {} for node in unknown}
        for name in (n for n in graph.ends if n in known):
            tail, head = graph.ends[name]
            if tail != head:
                enters[head][name], enters[tail][name] = 1, -1
        bridges = {frozenset(pair) for pair in nx.bridges(unknown)}
        self.below: dict[str, int] = {}
        self._root: dict[int, int] = {}
        self._sum: dict[int, Terms] = {node: {} for node in unknown}
        for part in nx.connected_components(unknown):
            root = min(part)  # the surroundings come first, so they are a root
            parent = nx.dfs_predecessors(unknown, root)
            for node in nx.dfs_postorder_nodes(unknown, root):
                self._root[node] = root
                _add(self._sum[node], enters[node])
                if node == root:
                    continue
                above = parent[node]
                _add(self._sum[above], self._sum[node])
                if frozenset((above, node)) in bridges:
                    (name,) = unknown[above][node]
                    self.below[name] = node

    def flow(self, name: str) -> FixedFlow | None:
        """The flow of a module, if it is a bridge and some known flow crosses the cut."""
        node = self.below.get(name)
        if node is None:
            return None
        tail, _ = self._ends[name]
        # A subtree is the side that the root is not in; the tail is in it if it is `node`,
        # as no other edge joins the two sides.
        inner, root = self._sum[node], self._root[node]
        if tail == node:
            terms, upstream = dict(inner), True
        elif root == SURROUNDINGS:
            terms, upstream = _negative(inner), False
        else:
            terms, upstream = dict(self._sum[root]), True
            _add(terms, _negative(inner))
        return FixedFlow(terms, upstream) if terms else None


def _add(total: Terms, more: Terms) -> None:
    """Add in place; what cancels is dropped."""
    for name, sign in more.items():
        value = total.get(name, 0) + sign
        if value:
            total[name] = value
        else:
            total.pop(name, None)


def _negative(terms: Terms) -> Terms:
    return {name: -sign for name, sign in terms.items()}
