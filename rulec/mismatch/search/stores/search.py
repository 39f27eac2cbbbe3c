"""Which explanations, alone and together, the recording asks for.

Two omissions can hide each other: one alone then gains next to nothing. So several of the best
models are carried along, and each is tried with every further candidate.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.stores.drift import drift_of, no_drift
from rulec.mismatch.evidence.stores.fit import Fitted, Judged
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search import limits
from rulec.mismatch.search.stores.beam import distinct, swaps_of, tasks_of
from rulec.mismatch.search.stores.masked_pair import hiding_pairs
from rulec.mismatch.search.stores.nested_models import begun_alike, with_kin
from rulec.mismatch.search.stores.nonparametric_term import or_nameless
from rulec.mismatch.search.stores.price import needed
from rulec.mismatch.search.stores.searcher import Searcher

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """The recalibrated model, and the best one with explanations, which may be the same.

    `judged` says which samples count; `tried` how many candidates there were; `alone` what each of
    them gains by itself, by id, `singles` the models with one of them, best first.
    """

    plain: Fitted
    best: Fitted
    judged: Judged
    tried: int
    alone: Mapping[str, float]
    singles: tuple[Fitted, ...] = ()


def search(bench: SimulationProblem, tell: Progress, workers: int = 2) -> Found:
    """Find what is missing."""
    candidates = bench.candidates
    tell("recalibrating the plain model")
    none = np.zeros(0)
    plain = Searcher(bench, Judged(bench.known, {}, no_drift(bench), none), workers).plain()
    drift = drift_of(bench, (), plain.values)
    judged = Judged(bench.known, plain.noise, drift, np.zeros(drift.count))
    searcher = Searcher(bench, judged, workers)
    plain = searcher.polished(replace(plain, slow=judged.slow, drift=drift))
    if _is_white(plain) and not searcher.promise(plain, candidates):
        return Found(plain, plain, judged, len(candidates), {})
    tell(f"trying {len(candidates)} explanations alone")
    singles = searcher.ranked(tasks_of([plain], candidates), plain)
    bare = [plain]
    better = _where_they_led(searcher, plain, singles)
    if better is not None:
        plain = better
        bare = [better, *bare]
        if _is_white(plain) and not searcher.promise(plain, candidates):
            return Found(plain, plain, judged, len(candidates), {})
        singles = searcher.ranked(tasks_of([plain], candidates), plain)
    alone = {f.ids[0]: searcher.gain(f, plain) for f in singles}
    single = tuple(c for c in candidates if not c.members)
    tell("looking at pairs that hide each other")
    hiding = _hiding(searcher, plain, singles, single)
    levels, singles = _grown(searcher, plain, singles, hiding, single, tell)
    # What is not needed is left out afterwards: of two that hide each other neither is, alone.
    best = _likeliest(searcher, itertools.chain(*levels, hiding), plain)
    turned = searcher.turned(best)
    alike = [f for f in turned if len(f.joined) == 1]
    singles = _each_once(searcher, [*alike, *singles], plain)
    best = _likeliest(searcher, (best, *turned), plain)
    tell("trying terms without physics")
    best = or_nameless(searcher, best, bare, len(candidates))
    return Found(plain, best, judged, len(candidates), alone, tuple(singles))


def _grown(
    searcher: Searcher,
    plain: Fitted,
    singles: list[Fitted],
    hiding: Sequence[Fitted],
    candidates: Sequence[Candidate],
    tell: Progress,
) -> tuple[list[tuple[Fitted, ...]], list[Fitted]]:
    """Models of ever more explanations, each level from the last; single ones, fitted further."""
    levels: list[tuple[Fitted, ...]] = [(plain,)]
    for depth in range(1, limits.DEEPEST + 1):
        ranked = singles
        if depth > 1:
            tell(
                f"trying {len(candidates)} explanations on {len(levels[-1])} models, depth {depth}"
            )
            ranked = searcher.ranked(tasks_of(levels[-1], candidates), plain)
        refined = searcher.refined(_carried(searcher, ranked, plain), plain)
        refined = with_kin(searcher, refined, candidates, plain)
        if depth == 1:
            refined = begun_alike(searcher, refined, singles, plain)
            singles = _each_once(searcher, [*refined, *singles], plain)
        if depth == 2:
            refined = _ordered(searcher, [*refined, *hiding], plain)
        beam = _carried(searcher, refined, plain)
        if depth > 1 and beam and not _is_white(beam[0]):
            tell("exchanging single explanations")
            swapped = [t for model in beam[: limits.SWAPPED] for t in swaps_of(model, candidates)]
            more = distinct(searcher.ranked(swapped, plain))[: limits.SWAPPED]
            every = _ordered(searcher, [*beam, *searcher.refined(more, plain)], plain)
            beam = _carried(searcher, every, plain)
        if not beam:
            break
        levels.append(
            tuple(beam if depth == 1 else _carried(searcher, beam, plain, limits.NARROWED))
        )
        if _is_white(beam[0]) or (depth > 1 and _stands_still(searcher, levels, plain)):
            break
    return levels, singles


def _hiding(
    searcher: Searcher, plain: Fitted, singles: Sequence[Fitted], candidates: Sequence[Candidate]
) -> list[Fitted]:
    """Pairs whose parts hide each other, which gain more than any single one; all pairs are looked
    at, and that is paid for."""
    pairs = needed(len(candidates) * (len(candidates) - 1) // 2)
    tasks = hiding_pairs(searcher, plain, candidates, limits.HOPELESS * pairs)
    found = searcher.refined(searcher.ranked(tasks, plain), plain)
    least = max((searcher.gain(f, plain) for f in singles), default=0.0) + pairs
    return [f for f in found if searcher.gain(f, plain) > least]


def _carried(
    searcher: Searcher, ranked: Sequence[Fitted], plain: Fitted, most: int = limits.BEAM
) -> list[Fitted]:
    """Of ranked models those that are carried along: the first ones, and the whitest."""
    kept = distinct(ranked)[:most]
    by_gain = distinct(sorted(ranked, key=lambda f: -searcher.gain(f, plain)))
    ids = {f.ids for f in kept}
    return [*kept, *(f for f in by_gain[: limits.WHITEST] if f.ids not in ids)]


def _ordered(searcher: Searcher, models: Iterable[Fitted], plain: Fitted) -> list[Fitted]:
    return sorted(models, key=lambda f: -searcher.standing(f, plain))


def _likeliest(searcher: Searcher, models: Iterable[Fitted], plain: Fitted) -> Fitted:
    return max(models, key=lambda f: searcher.gain(f, plain))


def _each_once(searcher: Searcher, models: Sequence[Fitted], plain: Fitted) -> list[Fitted]:
    """Of models with the same explanations the best: one may have been fitted further."""
    best: dict[tuple[str, ...], Fitted] = {}
    for model in models:
        known = best.get(model.ids)
        if known is None or searcher.gain(model, plain) > searcher.gain(known, plain):
            best[model.ids] = model
    return list(best.values())


def _where_they_led(searcher: Searcher, plain: Fitted, singles: Sequence[Fitted]) -> Fitted | None:
    """The plain model fitted anew from where explanations led, if that is better.

    What looks like a gain of theirs may be that of another optimum of the plain model.
    """
    known = plain.values.keys()
    for near in singles[: limits.LED]:
        values = {n: v for n, v in near.values.items() if n in known}
        found = searcher.polished(replace(plain, values=values))
        if searcher.gain(found, plain) > limits.LEAST_STEP:
            return found
    return None


def _is_white(fitted: Fitted) -> bool:
    """Nothing is left to explain."""
    return all(noise.memory < limits.WHITE for noise in fitted.noise.values())


def _stands_still(searcher: Searcher, levels: Sequence[Sequence[Fitted]], plain: Fitted) -> bool:
    """The last explanation was not worth its price; of two, both may be needed at once."""
    now, before = (searcher.standing(level[0], plain) for level in (levels[-1], levels[-2]))
    return now < limits.LEAST_STEP or (len(levels) > 3 and now < before + limits.LEAST_STEP)
