"""How sure each explanation is: the model without it, and with others in its place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from runtime.mismatch.candidate import Candidate
from runtime.mismatch.dynamic.fit import Fitted, Fitter
from runtime.mismatch.dynamic.price import needed
from runtime.mismatch.dynamic.search import Found, Searcher, at_an_end
from runtime.mismatch.result import Confounded, Rival

CONFOUNDED = 0.9
"""Correlation beyond which two values are not told apart."""

DROP = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval (chi-square with one degree, half)."""

REFINED = 5
"""Steps of the search for each end of an interval."""

Odds = tuple[tuple[Candidate, float], ...]


@dataclass(frozen=True)
class Accepted:
    """An explanation that the final model has: its own gain, and the odds of others instead."""

    candidate: Candidate
    gain: float
    others: Odds
    rivals: tuple[Rival, ...]

    @property
    def probability(self) -> float:
        """Against all others that would do."""
        return 1.0 / (1.0 + sum(odds for _, odds in self.others))


def doubted(searcher: Searcher, found: Found) -> tuple[Fitted, tuple[Accepted, ...]]:
    """Leave out what is not needed, exchange what another explains better, and weigh the rest."""
    best = found.best
    for _ in range(len(best.joined) + 1):
        if not best.joined:
            return best, ()
        without = {c.id: _without(searcher, best, c, found.plain) for c in best.joined}
        worst = min(best.joined, key=lambda c: searcher.gain(best, without[c.id]))
        if searcher.gain(best, without[worst.id]) < needed(found.tried):
            best = without[worst.id]
            continue
        better = _exchanged(searcher, best, without, found.plain)
        if better is None:
            break
        best = better
    if not best.joined:
        return best, ()
    without = {c.id: _without(searcher, best, c, found.plain) for c in best.joined}
    accepted = []
    for candidate in best.joined:
        bare = without[candidate.id]
        rivals = (Rival("the model without it", searcher.gain(bare, best)),)
        others = _others(searcher, best, bare, candidate, found.plain)
        accepted.append(Accepted(candidate, searcher.gain(best, bare), others, rivals))
    return best, tuple(accepted)


def _without(searcher: Searcher, model: Fitted, left: Candidate, plain: Fitted) -> Fitted:
    """The model without one explanation, fitted anew from here and from the plain model."""
    rest = tuple(c for c in model.joined if c.id != left.id)
    if not rest:
        return plain
    values = {n: v for n, v in model.values.items() if not n.startswith(f"{left.id}.")}
    return searcher.polished(searcher.trial(replace(model, joined=rest, values=values), rest))


def _swaps(
    searcher: Searcher, bare: Fitted, out: Candidate
) -> list[tuple[Fitted, tuple[Candidate, ...]]]:
    single = (c for c in searcher.bench.candidates if not c.members)
    return [(bare, (*bare.joined, c)) for c in single if c.id not in bare.ids and c.id != out.id]


def _exchanged(
    searcher: Searcher, best: Fitted, without: dict[str, Fitted], plain: Fitted
) -> Fitted | None:
    """A better model with one explanation exchanged for another, if there is one."""
    tasks = [t for c in best.joined for t in _swaps(searcher, without[c.id], c)]
    tried = [f for f in searcher.trials(tasks, plain) if not at_an_end(f)]
    ahead = max(tried, key=lambda f: searcher.gain(f, best), default=None)
    if ahead is None or searcher.gain(ahead, best) < 0.0:
        return None
    polished = searcher.polished(ahead)
    return polished if searcher.gain(polished, best) > 0.5 else None


def _others(searcher: Searcher, best: Fitted, bare: Fitted, out: Candidate, plain: Fitted) -> Odds:
    """Odds of other explanations in its place, the likeliest first."""
    tasks = _swaps(searcher, bare, out)
    odds = []
    for fitted in searcher.trials(tasks, plain):
        if not at_an_end(fitted):
            ahead = searcher.gain(fitted, best)
            odds.append((fitted.joined[-1], float(np.exp(np.clip(ahead, -700.0, 5.0)))))
    return tuple(sorted(odds, key=lambda o: -o[1]))


def profile(searcher: Searcher, best: Fitted, name: str) -> tuple[float, float]:
    """95 % interval of a value by its profile likelihood, all others fitted anew.

    Source: Venzon and Moolgavkar 1988.
    """
    fitter = Fitter(searcher.bench, best.joined, searcher.kept(best))
    judged = replace(searcher.judged, noise=best.noise)
    basis = judged.basis()
    at = fitter.vector(best.values)
    i, u = best.free.index(name), best.u(name)
    low, high = fitter.bounds(name)
    bottom = fitter.cost(at, judged, basis)
    ends = []
    for side in (-1.0, 1.0):
        reach = (at[i] - low) if side < 0 else (high - at[i])
        step, good, bad = min(1.96 * u, reach), 0.0, np.inf
        for _ in range(REFINED):
            if step <= 0.0:
                break
            fall = fitter.fall(at, i, at[i] + side * step, judged, basis) - bottom
            if fall < DROP:
                good = step
                if step >= reach:
                    break
                grow = 3.0 if fall <= 0 else float(np.clip(np.sqrt(DROP / fall), 1.1, 3.0))
                step = min(step * grow, reach, 0.5 * (good + bad) if np.isfinite(bad) else reach)
            else:
                bad = step
                step = max(step * float(np.sqrt(DROP / fall)), 0.5 * (good + bad) * 0.5)
            if abs(fall - DROP) < 0.1:
                break
        ends.append(float(at[i] + side * step))
    return ends[0], ends[1]


def confounded(best: Fitted) -> tuple[Confounded, ...]:
    """Unknowns that go along with another value."""
    brought = {u.id for c in best.joined for u in c.unknowns}
    size = np.sqrt(np.maximum(np.diag(best.covariance), 1e-300))
    correlation = best.covariance / np.outer(size, size)
    found = []
    for i, first in enumerate(best.free):
        for j, second in enumerate(best.free):
            if first in brought and (second not in brought or j > i):
                value = float(correlation[i, j])
                if abs(value) > CONFOUNDED:
                    found.append(Confounded(first, second, value))
    return tuple(sorted(found, key=lambda c: -abs(c.correlation)))
