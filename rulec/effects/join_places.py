"""Which places of a module a join asks for: by what their equations are, never by name."""

from __future__ import annotations

from collections.abc import Iterable

from rulec.effects.places import Site
from rulec.knowledge.effect import Join
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import INFLOW, OUTFLOW
from rulec.knowledge.plant import Module
from rulec.language.units import VOLUME_FLOW


def matching(join: Join, sites: Iterable[Site], knowledge: Knowledge, module: Module) -> list[Site]:
    """Places that a join asks for, of those that stand on one another only the innermost."""
    if join.stores or join.shows or join.flows:
        return [s for s in sites if _stores(join, s)]
    if join.reads:
        kind = module.type.signals
        signals = (s for s in sites if s.kind == "signal" and s.observers)
        return [s for s in signals if join.reads in ("any", kind[s.name].quantity)]
    wanted = knowledge.units.quantities[join.gives]
    fitting = [
        s
        for s in sites
        if s.kind in ("definition", "observer")
        and s.observers
        and (s.reads or s.name in _ENDS)
        and s.dimension == wanted
        and s.measured == join.measured
        and not _is_reference(s, module)
        and _is_estimate(s)
    ]
    inner = {s.name for s in fitting if s.kind == "definition"}
    return [
        s for s in fitting if not s.uses & (inner - {s.name} if s.kind != "observer" else inner)
    ]


_ENDS = {INFLOW: "in", OUTFLOW: "out"}


def _stores(join: Join, site: Site) -> bool:
    """Does a place of a module that stores fit?"""
    if join.flows:
        return site.name in _ENDS and _ENDS[site.name] == join.flows and bool(site.observers)
    if join.stores:
        return site.kind == "balance" and site.quantity == join.stores
    return site.kind == "reading" and join.shows in ("any", site.quantity)


def _is_reference(site: Site, module: Module) -> bool:
    return site.kind == "observer" and module.type.observers[site.name].is_reference


def _is_estimate(site: Site) -> bool:
    """A flow that is subtracted from an estimate, such as leakage, is no relation of its own."""
    return site.dimension != VOLUME_FLOW or all(slope >= 0.0 for slope in site.moves.values())
