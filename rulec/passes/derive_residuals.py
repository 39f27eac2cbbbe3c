"""Pass 4, derive residuals: pairs of flow estimates that must agree."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from rulec.algebra.continuity import FixedFlow
from rulec.algebra.eliminate import Span
from rulec.knowledge.plant import Module
from rulec.language.write_yaml import signed_sum
from rulec.passes.limits import MOST_SUMMED
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
    """Own pairs of each module, sums by continuity against own observers, then what is missing.

    For example, the sum of the pumps upstream against the resistance of a mixer becomes
    ``pump-resis`` of the mixer: `A.pump + B.pump - C.resis`. All comparisons that the junction
    balances allow are linear combinations of the residuals.

    >>> from rulec.passes.pipeline import example
    >>> residual = next(r for r in example("residuals").residuals if r.module == "C")
    >>> f"{residual.id} = {residual}"
    'C.pump-resis = A.pump + B.pump - C.resis'
    """
    modules = network.plant.modules.values()
    measured = [m.name for m in modules if m.type.observers]
    balances = tuple(network.graph.measured_balances(measured).values())
    # The largest number of other modules that a module meets at a place.
    meets: Counter[str] = Counter()
    for signs in balances:
        for name in signs:
            meets[name] = max(meets[name], len(signs) - 1)
    sums = _informative_sums(network)
    found: dict[Terms, Residual] = {}
    for module in modules:
        near = {
            kind: flow
            for kind, flow in sums.get(module.name, {}).items()
            if len(flow.terms) <= max(MOST_SUMMED, meets[module.name])
        }
        for residual in (*_pairs(module, module.type.residuals), *_summed(module, near)):
            found.setdefault(_without_sign(residual.terms), residual)
    return (*found.values(), *_left_out(network, balances, found.values()))


def _informative_sums(network: Network) -> dict[str, dict[str, FixedFlow]]:
    """Flows by continuity, by module and kind, without those that follow from others.

    Sums of flows that enter upstream are all kept. A sum of flows that leave often only repeats
    them from the view of another module.
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


def _pairs(module: Module, pairs: Iterable[tuple[str, str]]) -> Iterator[Residual]:
    for first, second in pairs:
        pair = ((1, f"{module.name}.{first}"), (-1, f"{module.name}.{second}"))
        yield Residual(f"{module.name}.{first}-{second}", module.name, pair)


def _summed(module: Module, sums: Mapping[str, FixedFlow]) -> Iterator[Residual]:
    """The flow of a module by continuity against its own observers."""
    for kind, flow in sums.items():
        others = tuple((sign, f"{name}.{kind}") for name, sign in flow.terms.items())
        for own in module.type.observers:
            terms = (*others, (-1, f"{module.name}.{own}"))
            yield Residual(f"{module.name}.{kind}-{own}", module.name, terms)


def _without_sign(terms: Terms) -> Terms:
    """The same terms for a sum and its negative."""
    ordered = sorted(terms, key=lambda t: t[1])
    return tuple((sign * ordered[0][0], name) for sign, name in ordered)


def _left_out(
    network: Network, balances: Iterable[Mapping[str, int]], present: Iterable[Residual]
) -> Iterator[Residual]:
    """Comparisons that do not follow from those present.

    Candidates are the first observer of each module against each other one, and the balances.
    """
    modules = network.plant.modules
    number = {name: i for i, name in enumerate(network.plant.observers)}
    span = Span()
    for residual in present:
        span.add({number[o]: sign for sign, o in residual.terms})
    candidates: list[Residual] = []
    for module in modules.values():
        first, *others = module.type.observers or ("",)
        candidates += _pairs(module, [(first, other) for other in others])
    candidates += [_balance(modules, signs) for signs in balances]
    for residual in candidates:
        if span.add({number[o]: sign for sign, o in residual.terms}):
            yield residual


def _balance(modules: Mapping[str, Module], signs: Mapping[str, int]) -> Residual:
    """A balance of measured flows, for the first module that leaves (else enters) the place.

    ``C.pump+flow-resis`` compares C with inflows estimated by observers of two kinds.
    """
    kinds = {name: tuple(modules[name].type.observers) for name in signs}
    count = Counter(kind for own in kinds.values() for kind in own)
    # The commonest kind first, in one order for all, so that no two ids are equal.
    ranked = [kind for kind, _ in count.most_common()]
    chosen = {name: min(own, key=ranked.index) for name, own in kinds.items()}
    own = min(signs, key=lambda name: signs[name])
    others = [name for name in signs if name != own]
    terms = [(-signs[own] * signs[name], f"{name}.{chosen[name]}") for name in others]
    other = "+".join(dict.fromkeys(chosen[name] for name in others))
    pair = f"{other}-{chosen[own]}" if signs[own] < 0 else f"{chosen[own]}-{other}"
    return Residual(f"{own}.{pair}", own, (*terms, (-1, f"{own}.{chosen[own]}")))
