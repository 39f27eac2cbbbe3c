"""Which explanations, alone and together, the recording asks for.

Two omissions can hide each other: one alone then gains next to nothing. So several of the best
models are carried along, and each is tried with every further candidate.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.mismatch.candidate import Candidate
from runtime.mismatch.dynamic.beam import BEAM, Task, distinct, swaps_of, tasks_of
from runtime.mismatch.dynamic.bench import Bench
from runtime.mismatch.dynamic.drift import drift_of, no_drift
from runtime.mismatch.dynamic.fit import Fitted, Judged
from runtime.mismatch.dynamic.hiding import hiding_pairs
from runtime.mismatch.dynamic.price import needed
from runtime.mismatch.dynamic.searcher import HOPEFUL, Searcher
from runtime.mismatch.price import SURPASSED

DEEPEST = 3
"""Explanations at most: any course is explained by enough of them."""

NARROWED = 3
"""Models of two explanations or more that are carried along."""

WHITEST = 2
"""Models that are carried along beside those, as what they leave looks most like noise. Where the
plain model is off for long stretches there is little news by its memory: then models hardly stand
apart, and prices decide."""

SWAPPED = 2
"""Models of each level in which single explanations are exchanged."""

LED = 3
"""The best explanations from whose values the plain model is fitted anew."""

STEP = 1.0
"""Gain of one more explanation below which no further one is tried."""

WHITE = 1.3
"""Errors that stay as they are for fewer samples than this have no structure to explain."""

MOST = 12
"""Readings and states that a term without physics may follow."""

PIECES = (3, 2, 1)
"""Pieces of a curve over one of them: as many as its values tell apart."""

APART = 0.05
"""Share of the range of its values by which ends of pieces differ at least."""

DRAWN = 4
"""Curves that are fitted to the end."""

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


def search(bench: Bench, tell: Progress, workers: int = 2) -> Found:
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
    levels: list[tuple[Fitted, ...]] = [(plain,)]
    single = tuple(c for c in candidates if not c.members)
    tell("looking at pairs that hide each other")
    hiding = _hiding(searcher, plain, singles, single)
    for depth in range(1, DEEPEST + 1):
        ranked = singles
        if depth > 1:
            tell(f"trying {len(single)} explanations on {len(levels[-1])} models, depth {depth}")
            ranked = searcher.ranked(tasks_of(levels[-1], single), plain)
        refined = searcher.refined(_carried(searcher, ranked, plain), plain)
        refined = searcher.with_kin(refined, single, plain)
        if depth == 1:
            refined = searcher.begun_alike(refined, singles, plain)
            singles = _each_once(searcher, [*refined, *singles], plain)
        if depth == 2:
            refined = _ordered(searcher, [*refined, *hiding], plain)
        beam = _carried(searcher, refined, plain)
        if depth > 1 and beam and not _is_white(beam[0]):
            tell("exchanging single explanations")
            swapped = [t for model in beam[:SWAPPED] for t in swaps_of(model, single)]
            more = distinct(searcher.ranked(swapped, plain))[:SWAPPED]
            every = _ordered(searcher, [*beam, *searcher.refined(more, plain)], plain)
            beam = _carried(searcher, every, plain)
        if not beam:
            break
        levels.append(tuple(beam if depth == 1 else _carried(searcher, beam, plain, NARROWED)))
        if _is_white(beam[0]):
            break
        if depth > 1 and searcher.standing(beam[0], plain) < STEP:
            break
        if depth > 2 and _stands_still(searcher, levels, plain):
            break
    # What is not needed is left out afterwards: of two that hide each other neither is, alone.
    best = _likeliest(searcher, itertools.chain(*levels, hiding), plain)
    turned = searcher.turned(best)
    alike = [f for f in turned if len(f.joined) == 1]
    singles = _each_once(searcher, [*alike, *singles], plain)
    best = _likeliest(searcher, (best, *turned), plain)
    tell("trying terms without physics")
    best = _or_nameless(searcher, best, bare, len(candidates))
    return Found(plain, best, judged, len(candidates), alone, tuple(singles))


def _hiding(
    searcher: Searcher, plain: Fitted, singles: Sequence[Fitted], candidates: Sequence[Candidate]
) -> list[Fitted]:
    """Pairs whose parts hide each other, which gain more than any single one; all pairs are looked
    at, and that is paid for."""
    pairs = needed(len(candidates) * (len(candidates) - 1) // 2)
    tasks = hiding_pairs(searcher, plain, candidates, HOPEFUL * pairs)
    found = searcher.refined(searcher.ranked(tasks, plain), plain)
    least = max((searcher.gain(f, plain) for f in singles), default=0.0) + pairs
    return [f for f in found if searcher.gain(f, plain) > least]


def _carried(
    searcher: Searcher, ranked: Sequence[Fitted], plain: Fitted, most: int = BEAM
) -> list[Fitted]:
    """Of ranked models those that are carried along: the first ones, and the whitest."""
    kept = distinct(ranked)[:most]
    by_gain = distinct(sorted(ranked, key=lambda f: -searcher.gain(f, plain)))
    ids = {f.ids for f in kept}
    return [*kept, *(f for f in by_gain[:WHITEST] if f.ids not in ids)]


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
    for near in singles[:LED]:
        values = {n: v for n, v in near.values.items() if n in known}
        found = searcher.polished(replace(plain, values=values))
        if searcher.gain(found, plain) > STEP:
            return found
    return None


def _or_nameless(searcher: Searcher, named: Fitted, bare: Sequence[Fitted], tried: int) -> Fitted:
    """A place that follows a state or an input in a way that nobody can name, if that says more.

    A curve pays for each of its values, and for being free: where names are right it is behind.
    Several names that come near stand for something that no entry says. `bare` are optima of the
    plain model, the best first: a curve may show beside another of them only.
    """
    bench, plain = searcher.bench, bare[0]
    assert bench.ruleset.dynamics is not None
    states = (s.id for s in bench.ruleset.dynamics.states)
    drivers = (*states, *bench.balances(()).inputs)[:MOST]
    pieces = {driver: _pieces(searcher, plain, driver) for driver in drivers}
    tasks: list[Task] = [
        (model, (bench.workshop.free_form(spot.id, tuple(f"{d}~{i}/{n}" for i in range(n + 1))),))
        for model in bare
        for spot in bench.workshop.spots
        if spot.kind in ("balance", "definition")
        for d, n in pieces.items()
        if n > 0
    ]
    drawn = searcher.refined(searcher.ranked(tasks, plain)[:DRAWN], plain)
    best = max(drawn, key=lambda f: searcher.gain(f, plain), default=None)
    known = searcher.gain(named, plain)
    enough = needed(len(tasks)) + (SURPASSED * known if known > needed(tried) else 0.0)
    return best if best is not None and searcher.gain(best, plain) > enough else named


def _pieces(searcher: Searcher, plain: Fitted, driver: str) -> int:
    """Pieces of a curve over a state or an input; 0 where it stays as it is."""
    course = searcher.bench.trajectory(plain.ids, plain.values, driver, plain.inputs)
    span = float(np.nanmax(course) - np.nanmin(course))
    for count in PIECES:
        knots = np.nanquantile(course, np.linspace(0.0, 1.0, count + 1))
        if span > 0.0 and float(np.min(np.diff(knots))) > APART * span:
            return count
    return 0


def _is_white(fitted: Fitted) -> bool:
    """Nothing is left to explain."""
    return all(noise.memory < WHITE for noise in fitted.noise.values())


def _stands_still(searcher: Searcher, levels: Sequence[Sequence[Fitted]], plain: Fitted) -> bool:
    """The last explanation was not worth its price."""
    now, before = (searcher.standing(level[0], plain) for level in (levels[-1], levels[-2]))
    return now < before + STEP
