"""Flows into and out of modules that store: by their own laws, or by continuity.

A module with states cuts the network in two, as its inflow and outflow may differ. Each of its ends
is an edge of its own, to a store without a balance; elsewhere continuity holds as usual.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rulec.algebra.continuity import SURROUNDINGS, FlowGraph, flows_by_continuity
from rulec.knowledge.module_type import ENDS, INFLOW, OUTFLOW, ModuleType
from rulec.knowledge.plant import Plant
from rulec.language.diagnostics import Diagnostic, Refused


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
    known = _independent(plant, split, every)
    by_continuity = flows_by_continuity(split, known)
    result: dict[tuple[str, str], Sum] = {}
    for module in plant.modules.values():
        for end in ENDS:
            if end in module.type.definitions or not module.type.flows:
                continue
            edge = f"{module.name}|{end}" if module.type.cuts else module.name
            tail, head = edges[edge]
            if edge in known:
                result[module.name, end] = ((1, known[edge]),)
            elif edge in by_continuity:
                terms = by_continuity[edge].terms
                result[module.name, end] = tuple((sign, known[e]) for e, sign in terms.items())
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
    known: dict[str, KnownFlow] = {}
    for name, (tail, head) in graph.ends.items():
        kind = plant.modules[name].type
        if kind.cuts:
            edges[f"{name}|{INFLOW}"] = (tail, SURROUNDINGS)
            edges[f"{name}|{OUTFLOW}"] = (SURROUNDINGS, head)
            for end in ENDS:
                if end in kind.definitions:
                    known[f"{name}|{end}"] = KnownFlow(name, "end", end)
            continue
        edges[name] = (tail, head)
        if law := law_of(kind):
            known[name] = KnownFlow(name, "observer", law)
    return edges, known


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
    known = dict(every)
    while balances := graph.measured_balances(known):
        signs = next(iter(balances.values()))
        measured = [edge for edge in signs if known[edge].kind == "observer"]
        if not measured:
            names = ", ".join(f"'{edge.partition('|')[0]}'" for edge in signs)
            message = f"the flow between {names} is given more than once"
            hint = "leave one law out; it must follow from the others"
            raise Refused([Diagnostic(plant.place, "KB114", message, hint)])
        del known[measured[-1]]
    return known
