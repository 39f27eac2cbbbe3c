"""Pass 4, derive residuals: pairs of flow estimates that must agree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from rulec.algebra.continuity import FixedFlow
from rulec.algebra.span import Span
from rulec.knowledge.plant import Module
from rulec.language.written import signed_sum
from rulec.limits import MOST_SUMMED
from rulec.passes.link import Network

Terms = tuple[tuple[int, str], ...]
"""A signed sum of observers, as (sign, observer id)."""


@dataclass(frozen=True)
class Residual:
    """A signed sum of observers, zero in a healthy plant; terms are (sign, observer id)."""

    id: str
    module: str
    terms: Terms

    def __str__(self) -> str:
        return signed_sum(self.terms)


def derive_residuals(network: Network) -> tuple[Residual, ...]:
    """Own pairs of each module and balance sums against own observers, then what these leave out.

    The sum of the pumps upstream against the resistance of a mixer, for example, becomes
    ``pump-resis`` of the mixer: `A.pump + B.pump - C.resis`. All comparisons that the junction
    balances allow follow from the residuals.

    >>> from rulec.passes.pipeline import example
    >>> residual = next(r for r in example("residuals").residuals if r.module == "C")
    >>> f"{residual.id} = {residual}"
    'C.pump-resis = A.pump + B.pump - C.resis'
    """
    sums = _told(network)
    found: dict[Terms, Residual] = {}
    for module in network.plant.modules.values():
        for residual in (*_own(module), *_summed(module, sums.get(module.name, {}))):
            found.setdefault(_without_sign(residual.terms), residual)
    return (*found.values(), *_left_out(network, found.values()))


def _told(network: Network) -> dict[str, dict[str, FixedFlow]]:
    """Flows by module and kind that say something: a sum of what flows in always does.

    A sum of what flows out often only repeats, from another module's view, what such sums say.
    """
    number = {name: i for i, name in enumerate(network.plant.modules)}
    span, result = Span(), dict[str, dict[str, FixedFlow]]()

    def vector(name: str, flow: FixedFlow) -> dict[int, int]:
        return {**{number[m]: sign for m, sign in flow.terms.items()}, number[name]: -1}

    for (name, _), flow in network.sums.items():
        if flow.upstream and network.plant.modules[name].type.observers:
            span.add(vector(name, flow))
    repeated = {
        key
        for key, flow in network.sums.items()
        if not flow.upstream and span.holds(vector(key[0], flow))
    }
    for (name, kind), flow in network.sums.items():
        if (name, kind) not in repeated:
            result.setdefault(name, {})[kind] = flow
    return result


def _own(module: Module) -> Iterator[Residual]:
    """Pairs of observers that the maker declares."""
    for first, second in module.type.residuals:
        pair = ((1, f"{module.name}.{first}"), (-1, f"{module.name}.{second}"))
        yield Residual(f"{module.name}.{first}-{second}", module.name, pair)


def _summed(module: Module, sums: Mapping[str, FixedFlow]) -> Iterator[Residual]:
    """The flow of a module by others, against its own observers."""
    for kind, flow in sums.items():
        if len(flow.terms) > MOST_SUMMED:
            continue
        others = tuple((sign, f"{name}.{kind}") for name, sign in flow.terms.items())
        for own in module.type.observers:
            terms = (*others, (-1, f"{module.name}.{own}"))
            yield Residual(f"{module.name}.{kind}-{own}", module.name, terms)


def _without_sign(terms: Terms) -> Terms:
    """The same for a sum and its negative."""
    ordered = sorted(terms, key=lambda t: t[1])
    return tuple((sign * ordered[0][0], name) for sign, name in ordered)


def _left_out(network: Network, present: Iterable[Residual]) -> Iterator[Residual]:
    """Comparisons that do not follow from those present."""
    modules = network.plant.modules.values()
    number = {name: i for i, name in enumerate(network.plant.observers)}
    span = Span()
    for residual in present:
        span.add({number[o]: sign for sign, o in residual.terms})
    for residual in (*_undeclared(modules), *_balances(network)):
        if span.add({number[o]: sign for sign, o in residual.terms}):
            yield residual


def _undeclared(modules: Iterable[Module]) -> Iterator[Residual]:
    """The first observer of a module against each other one."""
    for module in modules:
        first, *others = (f"{module.name}.{o}" for o in module.type.observers or ("",))
        for other in others:
            pair = ((1, first), (-1, other))
            yield Residual(f"{first}-{other.removeprefix(module.name)[1:]}", module.name, pair)


def _balances(network: Network) -> Iterator[Residual]:
    """Every balance of measured flows, where modules have observers of different kinds.

    ``C.pump+flow-resis`` compares with C what flows in by observers of two kinds.
    """
    modules = network.plant.modules
    measured = [m.name for m in modules.values() if m.type.observers]
    for signs in network.graph.measured_balances(measured).values():
        yield _balance(modules, signs)


def _balance(modules: Mapping[str, Module], signs: Mapping[str, int]) -> Residual:
    """A balance, seen from the first module that leaves, else enters, the place."""
    kinds = {name: tuple(modules[name].type.observers) for name in signs}
    count = Counter(kind for own in kinds.values() for kind in own)
    # The commonest kind first, in one order for all: then no two names can be the same.
    ranked = [kind for kind, _ in count.most_common()]
    chosen = {name: min(own, key=ranked.index) for name, own in kinds.items()}
    own = min(signs, key=lambda name: signs[name])
    others = [name for name in signs if name != own]
    terms = [(-signs[own] * signs[name], f"{name}.{chosen[name]}") for name in others]
    other = "+".join(dict.fromkeys(chosen[name] for name in others))
    pair = f"{other}-{chosen[own]}" if signs[own] < 0 else f"{chosen[own]}-{other}"
    return Residual(f"{own}.{pair}", own, (*terms, (-1, f"{own}.{chosen[own]}")))
