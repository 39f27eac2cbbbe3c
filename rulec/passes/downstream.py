"""The terms of `downstream(name)`: pressure losses of measured modules on the path downstream.

The path leads from the outlet of a module to where its circuit closes: its own inlet if it is in a
loop, else an open end. Pressure is a property of a node, so all branches between two nodes have
the same loss. If the path splits and meets again, one branch suffices, provided that all of its
modules measure their loss. A branch that leads back to the split is no path to the end. A module on
the only path that does not measure its loss counts as lossless.
"""

from collections.abc import Iterable, Mapping
from itertools import pairwise

import networkx as nx
from rulec_runtime.contract.ruleset import Junction

from rulec.algebra.continuity import SURROUNDINGS, FlowGraph
from rulec.knowledge.plant import Plant

Gathered = tuple[tuple[str, str], ...]
"""Signals as (module, signal)."""


class Undefined(Exception):
    """Raised if a downstream sum is undefined, with the reason and the remedy."""

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(reason)
        self.reason, self.remedy = reason, remedy


class Downstream:
    """Sums of the signals that modules provide, along the paths of a plant."""

    def __init__(self, plant: Plant, balances: tuple[Junction, ...], graph: FlowGraph) -> None:
        self._provided: dict[str, dict[str, str]] = {}
        for module in plant.modules.values():
            for name, signal in module.type.provides.items():
                self._provided.setdefault(name, {})[module.name] = signal
        self._inlet = {m: tail for m, (tail, _) in graph.ends.items()}
        # Each open end is a node of its own, as their pressures may differ.
        ends = (m for m, (_, head) in graph.ends.items() if head == SURROUNDINGS)
        own = {m: len(balances) + i for i, m in enumerate(ends)}
        self._head = {m: own.get(m, head) for m, (_, head) in graph.ends.items()}
        self._leaving = {i: b.inlets for i, b in enumerate(balances)}
        edges = [(i, self._head[m]) for i, names in self._leaving.items() for m in names]
        self._nodes = nx.DiGraph(edges)
        self._nodes.add_nodes_from(self._head.values())
        self._nodes.add_edges_from((node, SURROUNDINGS) for node in own.values())
        parts = nx.strongly_connected_components(self._nodes)
        self._loop = {node: i for i, part in enumerate(parts) for node in part}
        self._paths: dict[int, _Paths] = {}

    def sum(self, module: str, name: str) -> Gathered:
        """Signals that `downstream(name)` sums for a module; raises `Undefined`."""
        inlet, start = self._inlet[module], self._head[module]
        in_loop = inlet != SURROUNDINGS and self._loop[inlet] == self._loop[start]
        goal = inlet if in_loop else SURROUNDINGS
        if goal not in self._paths:
            self._paths[goal] = _Paths(self._nodes, self._leaving, self._head, goal)
        return self._paths[goal].sum(start, name, self._provided.get(name, {}))


class _Paths:
    """All paths to one goal."""

    def __init__(
        self,
        nodes: nx.DiGraph,
        leaving: Mapping[int, tuple[str, ...]],
        head: Mapping[str, int],
        goal: int,
    ) -> None:
        self._head = head
        self._nodes = nodes
        useful = nx.ancestors(nodes, goal) | {goal} if goal in nodes else {goal}
        self._leaving = {
            node: tuple(m for m in names if head[m] in useful)
            for node, names in leaving.items()
            if node in useful and node != goal
        }
        self._useful = useful
        self._meeting: Mapping[int, int] = {}
        if any(len(names) > 1 for names in self._leaving.values()):
            back = nodes.subgraph(useful).reverse()
            self._meeting = nx.immediate_dominators(back, goal)
        self._sums: dict[tuple[int, str], Gathered] = {}

    def sum(self, start: int, name: str, provided: Mapping[str, str]) -> Gathered:
        """Sum from a node to the goal; the sums from all nodes passed are cached."""
        if start not in self._useful:
            if not provided:
                return ()
            raise Undefined("the path never ends", "connect a module that leads out of the loop")
        passed, node = [], start
        while (node, name) not in self._sums and node in self._leaving:
            step, following = self._step(node, provided)
            passed.append((node, step))
            node = following
        found = self._sums.get((node, name), ())
        for node, step in reversed(passed):
            found = self._sums[node, name] = (*step, *found)
        return found

    def _step(self, node: int, provided: Mapping[str, str]) -> tuple[Gathered, int]:
        """Losses up to the next node that all paths pass, and that node."""
        paths = self._leaving[node]
        meeting = self._meeting[node] if len(paths) > 1 else self._head[paths[0]]
        region = self._between(node, meeting) if len(paths) > 1 else {node: paths}
        paths = region[node]
        if len(paths) == 1:
            return _signals(paths, provided), self._head[paths[0]]
        inside = [m for names in region.values() for m in names]
        if not any(m in provided for m in inside):
            return (), meeting
        parting = ", ".join(f"'{m}'" for m in paths)
        if meeting == SURROUNDINGS:
            remedy = "if they end at one pressure, lead them into one more module, such as a vessel"
            raise Undefined(f"the paths through {parting} end at different places", remedy)
        branch = self._measured(node, meeting, region, provided)
        if branch is None:
            remedy = "one branch needs a reading from every one of its modules"
            reason = f"the paths through {parting} meet again, but none is measured throughout"
            raise Undefined(reason, remedy)
        return _signals(branch, provided), meeting

    def _between(self, node: int, meeting: int) -> dict[int, tuple[str, ...]]:
        """Modules leaving each node on the paths to a meeting, except paths back to the start."""
        inside = nx.descendants(nx.restricted_view(self._nodes, [meeting], []), node)
        useful = nx.ancestors(self._nodes.subgraph({*inside, meeting}), meeting)
        return {
            p: tuple(m for m in self._leaving[p] if self._head[m] in {*useful, meeting})
            for p in sorted(useful | {node})
            if p in self._leaving
        }

    def _measured(
        self,
        node: int,
        meeting: int,
        region: Mapping[int, tuple[str, ...]],
        provided: Mapping[str, str],
    ) -> list[str] | None:
        """The shortest branch whose modules all measure their loss."""
        paths = [(p, self._head[m], m) for p in region for m in region[p][::-1] if m in provided]
        measured = nx.DiGraph((here, there, {"module": m}) for here, there, m in paths)
        measured.add_nodes_from([node, meeting])
        if not nx.has_path(measured, node, meeting):
            return None
        branch = nx.shortest_path(measured, node, meeting)
        return [measured.edges[step]["module"] for step in pairwise(branch)]


def _signals(modules: Iterable[str], provided: Mapping[str, str]) -> Gathered:
    return tuple((m, provided[m]) for m in modules if m in provided)
