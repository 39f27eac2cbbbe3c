"""Flows by continuity: which flows the junction balances fix, and as which sums.

A plant is a graph: junctions are nodes, modules are edges along their flow, and everything open
ends at one more node, the surroundings. Flows that balance are circulations of this graph. Two
facts of graph theory do the work: a flow is fixed by known flows exactly if its edge is a bridge
once the known edges are taken out, and it is then the net known flow into one side of the bridge.
So all factors are +1 or -1 and the effort is linear in the graph, whatever splits and loops it has.

Source: incidence matrices are totally unimodular (Poincare 1900); bridges after Tarjan (1974).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

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
        known, parent = set(measured), {n: n for pair in self.ends.values() for n in pair}
        parent[SURROUNDINGS] = SURROUNDINGS

        def root(node: int) -> int:
            while parent[node] != node:
                parent[node] = node = parent[parent[node]]
            return node

        for name, (tail, head) in self.ends.items():
            if name not in known:
                low, high = sorted((root(tail), root(head)))
                parent[high] = low
        return {node: root(node) for node in sorted(parent)}

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
    search = _Search(graph, given)
    return {name: flow for name in graph.ends if name not in given and (flow := search.flow(name))}


def without_flow(graph: FlowGraph) -> list[str]:
    """Modules in which nothing can flow, as they are the only link between two closed parts."""
    search = _Search(graph, set())
    return [name for name in graph.ends if search.is_bridge(name)]


class _Search:
    """Depth-first search over the edges of unknown flow; finds bridges and sums per subtree."""

    def __init__(self, graph: FlowGraph, known: set[str]) -> None:
        self._graph = graph
        self._open: dict[int, list[tuple[str, int]]] = {SURROUNDINGS: []}
        self._net: dict[int, Terms] = {SURROUNDINGS: {}}
        for name, (tail, head) in graph.ends.items():
            for node in (tail, head):
                self._open.setdefault(node, [])
                self._net.setdefault(node, {})
            if tail == head:
                continue
            if name in known:
                _add(self._net[head], {name: 1})
                _add(self._net[tail], {name: -1})
            else:
                self._open[tail].append((name, head))
                self._open[head].append((name, tail))
        self._below: dict[str, int] = {}  # bridge -> node at its far end from the root
        self._root: dict[int, int] = {}
        self._sum: dict[int, Terms] = {}
        for start in sorted(self._open):
            if start not in self._root:
                self._visit(start)

    def _visit(self, start: int) -> None:
        """Explore what hangs on `start`; the surroundings come first, so they are a root."""
        order: dict[int, int] = {start: 0}
        low: dict[int, int] = {start: 0}
        self._root[start] = start
        stack = [(start, "", iter(self._open[start]))]
        while stack:
            node, via, edges = stack[-1]
            for name, other in edges:
                if name == via:
                    continue
                if other in order:
                    low[node] = min(low[node], order[other])
                    continue
                order[other] = low[other] = len(order)
                self._root[other] = start
                stack.append((other, name, iter(self._open[other])))
                break
            else:
                stack.pop()
                total = self._sum.setdefault(node, {})
                _add(total, self._net[node])
                if stack:
                    parent = stack[-1][0]
                    low[parent] = min(low[parent], low[node])
                    if low[node] > order[parent]:
                        self._below[via] = node
                    _add(self._sum.setdefault(parent, {}), total)

    def is_bridge(self, name: str) -> bool:
        """Is the module the only link of unknown flow between two parts?"""
        return name in self._below

    def flow(self, name: str) -> FixedFlow | None:
        """The flow of a module, if its edge is a bridge and some known flow crosses the cut."""
        node = self._below.get(name)
        if node is None:
            return None
        tail, _ = self._graph.ends[name]
        # A subtree is the side that the root is not in; the tail is in it if it is `node`,
        # as no other edge joins the two sides.
        inner, root = self._sum[node], self._root[node]
        if tail == node:
            terms, upstream = inner, True
        elif root == SURROUNDINGS:
            terms, upstream = _negative(inner), False
        else:
            terms, upstream = dict(self._sum[root]), True
            _add(terms, _negative(inner))
        return FixedFlow(dict(terms), upstream) if terms else None


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
