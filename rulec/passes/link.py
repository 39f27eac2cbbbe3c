"""Pass 3, link: the network of a plant, its balances, and readings across modules."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import networkx as nx
from rulec_runtime.contract.ruleset import Junction

from rulec.algebra.continuity import (
    SURROUNDINGS,
    FixedFlow,
    FlowGraph,
    flows_by_continuity,
    without_flow,
)
from rulec.knowledge.module_type import ENDS, INFLOW, OUTFLOW, ModuleType
from rulec.knowledge.plant import Plant
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.passes.downstream import Downstream, Gathered, Undefined


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
    balances: tuple[Junction, ...]
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


def junctions(plant: Plant) -> tuple[Junction, ...]:
    """One balance per junction, which consists of all outlets and inlets that are connected."""
    pipes: nx.Graph = nx.Graph()
    for source, target in plant.connections:
        pipes.add_edge((source, "outlet"), (target, "inlet"))
    order = {name: i for i, name in enumerate(plant.modules)}
    result = []
    for junction in nx.connected_components(pipes):
        outlets = sorted((m for m, end in junction if end == "outlet"), key=order.__getitem__)
        inlets = sorted((m for m, end in junction if end == "inlet"), key=order.__getitem__)
        result.append(Junction(tuple(outlets), tuple(inlets)))
    return tuple(sorted(result, key=lambda b: order[b.inlets[0]]))


def _gathers(
    plant: Plant, balances: tuple[Junction, ...], graph: FlowGraph
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


def observed_through_states(network: Network) -> set[str]:
    """Modules whose flows or states affect a recorded reading through balances.

    If the plant maps columns, only mapped readings count as recorded.
    """
    upstream: dict[str, set[str]] = {}
    for (module, end), terms in network.ends.items():
        if end in network.plant.modules[module].type.read:
            upstream.setdefault(module, set()).update(flow.module for _, flow in terms)
    for (module, _), signals in network.gathers.items():
        upstream.setdefault(module, set()).update(m for m, _ in signals)
    mapped = {column.signal for column in network.plant.columns}
    waiting = [
        module.name
        for module in network.plant.modules.values()
        if any(not mapped or f"{module.name}.{name}" in mapped for name in module.type.readings)
    ]
    seen: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module not in seen:
            seen.add(module)
            waiting += upstream.get(module, ())
    return seen


# Flows into and out of modules that store: by their own laws, or by continuity. A module with
# states cuts the network in two, as its inflow and outflow may differ. Each of its ends is an edge
# of its own, to a store without a balance; elsewhere continuity holds as usual.


@dataclass(frozen=True)
class KnownFlow:
    """A known flow of a module; `kind` is ``observer`` or ``end``."""

    module: str
    kind: str
    name: str


Sum = tuple[tuple[int, KnownFlow], ...]
"""A signed sum of known flows; empty if nothing flows."""

EndFlows = Mapping[tuple[str, str], Sum]
"""Flow by module and end, if the module has no law of its own for it."""


def end_flows(plant: Plant, graph: FlowGraph) -> EndFlows:
    """Flows at the ends of all modules whose equations use them.

    Raises `Refused`: KB113 if a flow does not follow from the laws, KB114 if laws contradict.
    """
    if not any(m.type.flows for m in plant.modules.values()):
        return {}
    edges, every = _edges(plant, graph)
    split = FlowGraph(edges)
    laws = _independent(plant, split, every)
    by_continuity = flows_by_continuity(split, laws)
    result: dict[tuple[str, str], Sum] = {}
    for module in plant.modules.values():
        for end in ENDS:
            if end in module.type.definitions or not module.type.flows:
                continue
            edge = f"{module.name}|{end}" if module.type.cuts else module.name
            tail, head = edges[edge]
            if edge in laws:
                result[module.name, end] = ((1, laws[edge]),)
            elif edge in by_continuity:
                terms = by_continuity[edge].terms
                result[module.name, end] = tuple((sign, laws[e]) for e, sign in terms.items())
            elif tail == head or _is_closed(split, edge):
                result[module.name, end] = ()
            elif end in module.type.read:
                message = f"what flows {WAY[end]} '{module.name}' does not follow from any law"
                hint = f"give its type a definition '{end}', or connect something with a law"
                raise Refused([Diagnostic(plant.place, "KB113", message, hint)])
    return result


WAY = {INFLOW: "into", OUTFLOW: "out of"}
"""Ends in words, before the name of a module."""


def _edges(
    plant: Plant, graph: FlowGraph
) -> tuple[dict[str, tuple[int, int]], dict[str, KnownFlow]]:
    """Edges between junctions, and those with a law."""
    edges: dict[str, tuple[int, int]] = {}
    laws: dict[str, KnownFlow] = {}
    for name, (tail, head) in graph.ends.items():
        kind = plant.modules[name].type
        if kind.cuts:
            edges[f"{name}|{INFLOW}"] = (tail, SURROUNDINGS)
            edges[f"{name}|{OUTFLOW}"] = (SURROUNDINGS, head)
            for end in ENDS:
                if end in kind.definitions:
                    laws[f"{name}|{end}"] = KnownFlow(name, "end", end)
            continue
        edges[name] = (tail, head)
        if law := law_of(kind):
            laws[name] = KnownFlow(name, "observer", law)
    return edges, laws


def law_of(kind: ModuleType) -> str:
    """The observer that gives the flow: the first that reads only inputs, else the first."""
    given = {n for n, s in kind.signals.items() if not s.is_input}
    for observer in kind.observers.values():
        if given.isdisjoint(kind.names_through(observer.expression)):
            return observer.name
    return next(iter(kind.observers), "")


def _is_closed(graph: FlowGraph, edge: str) -> bool:
    """Whether no other edge is at the junction of this one, so that nothing flows."""
    nodes = [n for n in graph.ends[edge] if n != SURROUNDINGS]
    return not any(other != edge and set(ends) & set(nodes) for other, ends in graph.ends.items())


def _independent(
    plant: Plant, graph: FlowGraph, every: Mapping[str, KnownFlow]
) -> dict[str, KnownFlow]:
    """Laws without contradiction: if flows are measured twice, later measurements are dropped."""
    laws = dict(every)
    while balances := graph.measured_balances(laws):
        signs = next(iter(balances.values()))
        measured = [edge for edge in signs if laws[edge].kind == "observer"]
        if not measured:
            names = ", ".join(f"'{edge.partition('|')[0]}'" for edge in signs)
            message = f"the flow between {names} is given more than once"
            hint = "leave one law out; it must follow from the others"
            raise Refused([Diagnostic(plant.place, "KB114", message, hint)])
        del laws[measured[-1]]
    return laws
