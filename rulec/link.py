"""Pass 3, link: the network of a plant, its balances, and what reads across modules."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import networkx as nx

from rulec.language.diagnostics import Diagnostic, Refused
from rulec.plant import Plant


@dataclass(frozen=True)
class Balance:
    """Flows of `outlets` modules together become the flows of `inlets` modules."""

    outlets: tuple[str, ...]
    inlets: tuple[str, ...]


@dataclass(frozen=True)
class Network:
    """A plant with its connections resolved.

    Attributes
    ----------
    balances : one per junction of pipes.
    gathers : per (module, name) the signals that `downstream(name)` sums, as (module, signal).
    sums : per (module, kind) the flow of a module as signed sum of other modules' observers of
        that kind.
    """

    plant: Plant
    balances: tuple[Balance, ...]
    gathers: Mapping[tuple[str, str], tuple[tuple[str, str], ...]]
    sums: Mapping[tuple[str, str], tuple[tuple[int, str], ...]]


def link(plant: Plant) -> Network:
    """Resolve the connections of a plant.

    Raises `Refused` (KB087) where the plant has nothing that could be compared.
    """
    balances = _balances(plant)
    gathers = {
        (module.name, name): _downstream(plant, module.name, name)
        for module in plant.modules.values()
        for name in module.type.gathers
    }
    network = Network(plant, balances, gathers, _sums(plant, balances))
    observers = sum(len(m.type.observers) for m in plant.modules.values())
    if not observers:
        message = "no module of this plant has an observer; nothing can be compared"
        raise Refused([Diagnostic(plant.place, "KB087", message, "give a module type an observer")])
    return network


def _balances(plant: Plant) -> tuple[Balance, ...]:
    """One balance per junction: outlets and inlets that touch belong together."""
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


def _downstream(plant: Plant, start: str, name: str) -> tuple[tuple[str, str], ...]:
    """Signals provided under `name` along the way downstream.

    Where the way splits, the first connection counts: parallel branches between the same two
    points lose the same pressure, so any one of them gives the sum.
    """
    follower: dict[str, str] = {}
    for source, target in plant.connections:
        follower.setdefault(source, target)
    found, seen, here = [], {start}, follower.get(start)
    while here is not None and here not in seen:
        seen.add(here)
        signal = plant.modules[here].type.provides.get(name)
        if signal is not None:
            found.append((here, signal))
        here = follower.get(here)
    return tuple(found)


def _sums(
    plant: Plant, balances: tuple[Balance, ...]
) -> dict[tuple[str, str], tuple[tuple[int, str], ...]]:
    """Flows by continuity, for each kind of observer.

    A module without an observer of that kind gets its flow from the junction at its inlet, as
    soon as all other flows there are known; failing that (a split) from the one at its outlet.
    """
    kinds = list(dict.fromkeys(k for m in plant.modules.values() for k in m.type.observers))
    order = {name: i for i, name in enumerate(plant.modules)}
    result = {}
    for kind in kinds:
        own = [m.name for m in plant.modules.values() if kind in m.type.observers]
        for name, terms in by_continuity(balances, own).items():
            ordered = sorted(terms.items(), key=lambda t: order[t[0]])
            result[name, kind] = tuple((sign, m) for m, sign in ordered)
    return result


def by_continuity(balances: tuple[Balance, ...], own: Iterable[str]) -> dict[str, dict[str, int]]:
    """Flows of further modules as signed sums of those in `own`."""
    known = {name: {name: 1} for name in own}
    given = set(known)
    _peel(balances, known, upstream=True)
    _peel([b for b in balances if len(b.inlets) > 1], known, upstream=False)
    return {name: terms for name, terms in known.items() if name not in given and terms}


def _peel(
    balances: tuple[Balance, ...] | list[Balance],
    known: dict[str, dict[str, int]],
    upstream: bool,
) -> None:
    """Solve junctions that have one unknown flow left, until none is.

    With `upstream` only inlets of modules are solved for, else only outlets.
    """
    touching: dict[str, list[int]] = {}
    missing = []
    for i, balance in enumerate(balances):
        unknown = {m for m in (*balance.outlets, *balance.inlets) if m not in known}
        missing.append(unknown)
        for name in unknown:
            touching.setdefault(name, []).append(i)
    ready = [i for i, unknown in enumerate(missing) if len(unknown) == 1]
    while ready:
        i = ready.pop()
        if len(missing[i]) != 1:
            continue
        (name,) = missing[i]
        balance = balances[i]
        side, other = (
            (balance.inlets, balance.outlets) if upstream else (balance.outlets, balance.inlets)
        )
        if name not in side:
            continue
        known[name] = _signed(known, other, [m for m in side if m != name])
        for j in touching[name]:
            missing[j].discard(name)
            if len(missing[j]) == 1:
                ready.append(j)


def _signed(
    known: Mapping[str, dict[str, int]], plus: tuple[str, ...], minus: list[str]
) -> dict[str, int]:
    total: dict[str, int] = {}
    for sign, names in ((1, plus), (-1, minus)):
        for name in names:
            for module, factor in known[name].items():
                total[module] = total.get(module, 0) + sign * factor
    return {m: f for m, f in total.items() if f}
