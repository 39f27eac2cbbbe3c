"""The terms of `downstream(name)`: pressure losses of measured modules on the way downstream.

The way leads from the outlet of a module to where its circuit closes: its own inlet if it lies in a
loop, else an open end. Pressure is a property of a place, so all branches between two places have
the same loss. If the way splits and meets again, one branch suffices, provided that all of its
modules measure their loss. A branch that leads back to the split is no way to the end. A module on
the only way that does not measure its loss counts as lossless.
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
    """Sums of the signals that modules provide, along the ways of a plant."""

    def __init__(self, plant: Plant, balances: tuple[Junction, ...], graph: FlowGraph) -> None:
        self._provided: dict[str, dict[str, str]] = {}
        for module in plant.modules.values():
            for name, signal in module.type.provides.items():
                self._provided.setdefault(name, {})[module.name] = signal
        self._inlet = {m: tail for m, (tail, _) in graph.ends.items()}
        # Each open end is a place of its own, as their pressures may differ.
        ends = (m for m, (_, head) in graph.ends.items() if head == SURROUNDINGS)
        own = {m: len(balances) + i for i, m in enumerate(ends)}
        self._head = {m: own.get(m, head) for m, (_, head) in graph.ends.items()}
        self._leaving = {i: b.inlets for i, b in enumerate(balances)}
        edges = [(i, self._head[m]) for i, names in self._leaving.items() for m in names]
        self._places = nx.DiGraph(edges)
        self._places.add_nodes_from(self._head.values())
        self._places.add_edges_from((place, SURROUNDINGS) for place in own.values())
        parts = nx.strongly_connected_components(self._places)
        self._loop = {place: i for i, part in enumerate(parts) for place in part}
        self._ways: dict[int, _Ways] = {}

    def sum(self, module: str, name: str) -> Gathered:
        """Signals that `downstream(name)` sums for a module; raises `Undefined`."""
        inlet, start = self._inlet[module], self._head[module]
        in_loop = inlet != SURROUNDINGS and self._loop[inlet] == self._loop[start]
        goal = inlet if in_loop else SURROUNDINGS
        if goal not in self._ways:
            self._ways[goal] = _Ways(self._places, self._leaving, self._head, goal)
        return self._ways[goal].sum(start, name, self._provided.get(name, {}))


class _Ways:
    """All ways to one goal."""

    def __init__(
        self,
        places: nx.DiGraph,
        leaving: Mapping[int, tuple[str, ...]],
        head: Mapping[str, int],
        goal: int,
    ) -> None:
        self._head = head
        self._places = places
        useful = nx.ancestors(places, goal) | {goal} if goal in places else {goal}
        self._leaving = {
            place: tuple(m for m in names if head[m] in useful)
            for place, names in leaving.items()
            if place in useful and place != goal
        }
        self._useful = useful
        self._meeting: Mapping[int, int] = {}
        if any(len(names) > 1 for names in self._leaving.values()):
            back = places.subgraph(useful).reverse()
            self._meeting = nx.immediate_dominators(back, goal)
        self._sums: dict[tuple[int, str], Gathered] = {}

    def sum(self, start: int, name: str, provided: Mapping[str, str]) -> Gathered:
        """Sum from a place to the goal; the sums from all places passed are cached."""
        if start not in self._useful:
            if not provided:
                return ()
            raise Undefined("the way never ends", "connect a module that leads out of the loop")
        passed, place = [], start
        while (place, name) not in self._sums and place in self._leaving:
            step, following = self._step(place, provided)
            passed.append((place, step))
            place = following
        found = self._sums.get((place, name), ())
        for place, step in reversed(passed):
            found = self._sums[place, name] = (*step, *found)
        return found

    def _step(self, place: int, provided: Mapping[str, str]) -> tuple[Gathered, int]:
        """Losses up to the next place that all ways pass, and that place."""
        ways = self._leaving[place]
        meeting = self._meeting[place] if len(ways) > 1 else self._head[ways[0]]
        region = self._between(place, meeting) if len(ways) > 1 else {place: ways}
        ways = region[place]
        if len(ways) == 1:
            return _signals(ways, provided), self._head[ways[0]]
        inside = [m for names in region.values() for m in names]
        if not any(m in provided for m in inside):
            return (), meeting
        parting = ", ".join(f"'{m}'" for m in ways)
        if meeting == SURROUNDINGS:
            remedy = "if they end at one pressure, lead them into one more module, such as a vessel"
            raise Undefined(f"the ways through {parting} end at different places", remedy)
        branch = self._measured(place, meeting, region, provided)
        if branch is None:
            remedy = "one branch needs a reading from every one of its modules"
            reason = f"the ways through {parting} meet again, but none is measured throughout"
            raise Undefined(reason, remedy)
        return _signals(branch, provided), meeting

    def _between(self, place: int, meeting: int) -> dict[int, tuple[str, ...]]:
        """Modules leaving each place on the ways to a meeting, except ways back to the start."""
        inside = nx.descendants(nx.restricted_view(self._places, [meeting], []), place)
        useful = nx.ancestors(self._places.subgraph({*inside, meeting}), meeting)
        return {
            p: tuple(m for m in self._leaving[p] if self._head[m] in {*useful, meeting})
            for p in sorted(useful | {place})
            if p in self._leaving
        }

    def _measured(
        self,
        place: int,
        meeting: int,
        region: Mapping[int, tuple[str, ...]],
        provided: Mapping[str, str],
    ) -> list[str] | None:
        """The shortest branch whose modules all measure their loss."""
        ways = [(p, self._head[m], m) for p in region for m in region[p][::-1] if m in provided]
        measured = nx.DiGraph((here, there, {"module": m}) for here, there, m in ways)
        measured.add_nodes_from([place, meeting])
        if not nx.has_path(measured, place, meeting):
            return None
        branch = nx.shortest_path(measured, place, meeting)
        return [measured.edges[step]["module"] for step in pairwise(branch)]


def _signals(modules: Iterable[str], provided: Mapping[str, str]) -> Gathered:
    return tuple((m, provided[m]) for m in modules if m in provided)
