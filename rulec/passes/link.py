"""Pass 3, link: the network of a plant, its balances, and readings across modules."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import networkx as nx

from rulec.algebra.continuity import (
    Balance,
    FixedFlow,
    FlowGraph,
    flows_by_continuity,
    without_flow,
)
from rulec.knowledge.plant import Plant
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.passes.downstream import Downstream, Gathered, Undefined
from rulec.passes.end_flows import EndFlows, end_flows


@dataclass(frozen=True, kw_only=True)
class Network:
    """A plant with its connections resolved.

    Attributes
    ----------
    balances : one per junction of pipes.
    graph : junctions as nodes, modules as edges.
    gathers : per (module, name) the signals that `downstream(name)` sums, as (module, signal).
    sums : per (module, kind) the flow of a module as a signed sum of other modules' observers of
        that kind, in the order of the plant.
    ends : inflow and outflow of modules whose equations use them. A junction at a module that
        stores has no balance.
    """

    plant: Plant
    balances: tuple[Balance, ...]
    graph: FlowGraph
    gathers: Mapping[tuple[str, str], Gathered]
    sums: Mapping[tuple[str, str], FixedFlow]
    ends: EndFlows = field(default_factory=dict)

    @property
    def stores(self) -> bool:
        """Whether some module has states."""
        return any(m.type.states for m in self.plant.modules.values())


def link(plant: Plant) -> Network:
    """Resolve the connections of a plant.

    Raises `Refused` if nothing can be compared (KB087), a downstream sum is undefined (KB089),
    nothing can flow through a module (KB090), or a flow into or out of a module that stores does
    not follow (KB113) or follows twice (KB114).

    >>> from rulec.passes.pipeline import example
    >>> [str(m) for m in example("plant").plant.modules]
    ['A', 'B', 'C']
    >>> [(b.outlets, b.inlets) for b in example("network").network.balances]
    [(('A', 'B'), ('C',))]
    """
    every = junctions(plant)
    ends = end_flows(plant, FlowGraph.of(every, plant.modules))
    stores = {m.name for m in plant.modules.values() if m.type.cuts}
    balances = tuple(b for b in every if not stores.intersection((*b.outlets, *b.inlets)))
    graph = FlowGraph.of(balances, plant.modules)
    observers = sum(len(m.type.observers) for m in plant.modules.values())
    if not observers and not stores:
        message = "no module of this plant has an observer; nothing can be compared"
        hint = "give a module type an observer, or a state where it stores something"
        raise Refused([Diagnostic(plant.place, "KB087", message, hint)])
    stopped = without_flow(graph)
    if stopped:
        names = ", ".join(f"'{name}'" for name in stopped)
        message = f"nothing can flow through {names}: behind or before it all ways are closed"
        hint = "a connection is missing, or points the wrong way"
        raise Refused([Diagnostic(plant.place, "KB090", message, hint)])
    return Network(
        plant=plant,
        balances=balances,
        graph=graph,
        gathers=_gathers(plant, balances, graph),
        sums=_sums(plant, graph),
        ends=ends,
    )


def junctions(plant: Plant) -> tuple[Balance, ...]:
    """One balance per junction, which consists of all outlets and inlets that are connected."""
    pipes: nx.Graph = nx.Graph()
    for source, target in plant.connections:
        pipes.add_edge((source, "outlet"), (target, "inlet"))
    order = {name: i for i, name in enumerate(plant.modules)}
    result = []
    for junction in nx.connected_components(pipes):
        outlets = sorted((m for m, end in junction if end == "outlet"), key=order.__getitem__)
        inlets = sorted((m for m, end in junction if end == "inlet"), key=order.__getitem__)
        result.append(Balance(tuple(outlets), tuple(inlets)))
    return tuple(sorted(result, key=lambda b: order[b.inlets[0]]))


def _gathers(
    plant: Plant, balances: tuple[Balance, ...], graph: FlowGraph
) -> dict[tuple[str, str], Gathered]:
    """Downstream sums; raises `Refused` (KB089) with all reasons why some are undefined."""
    ways = Downstream(plant, balances, graph)
    result: dict[tuple[str, str], Gathered] = {}
    readers: dict[tuple[str, str, str], list[str]] = {}
    for module in plant.modules.values():
        for name in module.type.gathers:
            try:
                result[module.name, name] = ways.sum(module.name, name)
            except Undefined as why:
                reason = (name, why.reason, why.remedy)
                readers.setdefault(reason, []).append(f"'{module.name}'")
    if readers:
        raise Refused(
            Diagnostic(
                plant.place,
                "KB089",
                f"downstream({name}) is not defined for {', '.join(modules)}: {reason}",
                remedy,
            )
            for (name, reason, remedy), modules in readers.items()
        )
    return result


def _sums(plant: Plant, graph: FlowGraph) -> dict[tuple[str, str], FixedFlow]:
    """Flows by continuity, for each kind of observer."""
    kinds = list(dict.fromkeys(k for m in plant.modules.values() for k in m.type.observers))
    order = {name: i for i, name in enumerate(plant.modules)}
    result = {}
    for kind in kinds:
        own = [m.name for m in plant.modules.values() if kind in m.type.observers]
        for name, flow in flows_by_continuity(graph, own).items():
            terms = dict(sorted(flow.terms.items(), key=lambda t: order[t[0]]))
            result[name, kind] = FixedFlow(terms, flow.upstream)
    return result
