"""Flows by continuity: which flows the junction balances determine, and as which sums.

A plant is a graph: junctions are nodes, modules are edges along their flow, and all open ends meet
at one more node, the surroundings. Balanced flows are circulations of this graph. Known flows
determine a flow exactly if its edge is a bridge of the graph without the known edges; it then
equals the net known flow into one side of the bridge. So all factors are +1 or -1, and the effort
is linear in the size of the graph, whatever its splits and loops.

Source: incidence matrices are totally unimodular (Poincare 1900); bridges after Tarjan (1974).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

import networkx as nx
from rulec_runtime.contract.ruleset import Junction

Terms = dict[str, int]
"""A signed sum of modules' flows."""

SURROUNDINGS = -1
"""The node where all open ends meet. Its balance follows from the others."""


@dataclass(frozen=True)
class FixedFlow:
    """The flow of a module as a sum of others; `upstream`: of those into its inlet side."""

    terms: Terms
    upstream: bool


@dataclass(frozen=True)
class FlowGraph:
    """Junctions have the numbers of their balances; `ends`: inlet and outlet node per module."""

    ends: Mapping[str, tuple[int, int]]

    @staticmethod
    def of(balances: Sequence[Junction], modules: Iterable[str] = ()) -> FlowGraph:
        """The graph of `modules` and of all modules at a junction."""
        inlet = {m: i for i, b in enumerate(balances) for m in b.inlets}
        outlet = {m: i for i, b in enumerate(balances) for m in b.outlets}
        names = dict.fromkeys([*modules, *outlet, *inlet])
        ends = {m: (inlet.get(m, SURROUNDINGS), outlet.get(m, SURROUNDINGS)) for m in names}
        return FlowGraph(ends)

    def without(self, measured: Set[str]) -> nx.MultiGraph:
        """Junctions as nodes, modules of unknown flow as edges between them."""
        unknown = nx.MultiGraph()
        unknown.add_nodes_from([SURROUNDINGS, *(n for pair in self.ends.values() for n in pair)])
        for name, (tail, head) in self.ends.items():
            if name not in measured and tail != head:
                unknown.add_edge(tail, head, key=name)
        return unknown

    def measured_balances(self, measured: Iterable[str]) -> dict[int, dict[str, int]]:
        """Balances of known flows: per merged node the modules that enter (+1) and leave (-1).

        A merged node is all junctions that modules of unknown flow connect, numbered as the lowest.
        """
        measured = list(measured)
        parts = nx.connected_components(self.without(set(measured)))
        merged = {node: min(part) for part in parts for node in part}
        result: dict[int, dict[str, int]] = {}
        for name in measured:
            tail, head = (merged[node] for node in self.ends[name])
            if tail != head:
                result.setdefault(head, {})[name] = 1
                result.setdefault(tail, {})[name] = -1
        result.pop(merged[SURROUNDINGS], None)
        return dict(sorted(result.items()))


def flows_by_continuity(graph: FlowGraph, measured: Iterable[str]) -> dict[str, FixedFlow]:
    """Flows of further modules that the flows of `measured` determine.

    A sum of flows that enter upstream is preferred. Modules whose flow stays unknown, or is always
    zero, are left out.

    >>> graph = FlowGraph.of([Junction(("A", "B"), ("C",))])
    >>> flows_by_continuity(graph, ["A", "B"])
    {'C': FixedFlow(terms={'A': 1, 'B': 1}, upstream=True)}
    """
    given = set(measured)
    cuts = _Cuts(graph, given)
    return {name: flow for name in graph.ends if name not in given and (flow := cuts.flow(name))}


def without_flow(graph: FlowGraph) -> list[str]:
    """Modules without flow, because they are the only link between two closed parts."""
    cuts = _Cuts(graph, set())
    return [name for name in graph.ends if name in cuts.below]


class _Cuts:
    """Bridges among the modules of unknown flow, and the known flows into the parts they join.

    `below` maps a bridge to its end that is farther from the root of its part.
    """

    def __init__(self, graph: FlowGraph, measured: Set[str]) -> None:
        self._ends = graph.ends
        unknown = graph.without(measured)
        enters: dict[int, Terms] = {node: {} for node in unknown}
        for name in (n for n in graph.ends if n in measured):
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
        # The subtree of `node` is the side without the root. No other edge joins the two sides, so
        # the tail is in the subtree exactly if it is `node`.
        tail, root = self._ends[name][0], self._root[node]
        leaves = {other: -sign for other, sign in self._sum[node].items()}
        upstream = True
        if tail == node:
            terms = self._sum[node].copy()
        elif root == SURROUNDINGS:
            terms, upstream = leaves, False
        else:
            terms = self._sum[root].copy()
            _add(terms, leaves)
        return FixedFlow(terms, upstream) if terms else None


def _add(total: Terms, more: Terms) -> None:
    """Add in place; terms that cancel are dropped."""
    for name, sign in more.items():
        value = total.get(name, 0) + sign
        if value:
            total[name] = value
        else:
            total.pop(name, None)
