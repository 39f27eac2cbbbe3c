"""Fits models with explanations in them, several at a time, and says how they stand."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import MEDIAN, Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.drift import moved_again
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise, gain
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search import limits
from rulec.mismatch.search.stores.beam import Task
from rulec.mismatch.search.stores.price import needed, price_of


class Searcher:
    """Fits trials, several at a time."""

    def __init__(self, bench: SimulationProblem, judged: Judged, workers: int) -> None:
        self.bench, self.judged, self.workers = bench, judged, workers
        self.samples = {n: int(k.sum()) for n, k in judged.known.items()}

    def plain(self) -> Fitted:
        """The model without anything joined, recalibrated from many starts."""
        best = self.polished(
            self.trial(None, (), 4 * limits.SCATTERED, common.THOROUGH, 2 * limits.DESCENDED)
        )
        # Two tanks in a row look nearly alike the other way round.
        for first, second in self._alike(best):
            found = self.polished(self._turned(best, {first: second, second: first}))
            best = min(best, found, key=lambda f: -self.standing(f, best))
        return best

    def turned(self, fitted: Fitted) -> list[Fitted]:
        """A model with what it says of two modules said of each other, for all that look alike."""
        found = []
        for first, second in self._alike(fitted):
            turned = self._turned(fitted, {first: second, second: first})
            if set(turned.ids) != set(fitted.ids):
                found.append(self.polished(turned))
        return [f for f in found if not f.pressed]

    def _turned(self, fitted: Fitted, other: Mapping[str, str]) -> Fitted:
        """Each value given to its namesake in the other module, explanations with them."""
        joined = tuple(self._namesake(c, other) for c in fitted.joined)
        known = {*fitted.values, *(u.id for c in joined for u in c.unknowns)}
        left = {u.id for c in fitted.joined if c not in joined for u in c.unknowns}
        values = {n: v for n, v in fitted.values.items() if n not in left}
        for name, value in fitted.values.items():
            module, _, local = name.partition(".")
            if (there := f"{other.get(module)}.{local}") in known:
                values[there] = value
        return replace(fitted, joined=joined, values=values)

    def _namesake(self, candidate: Candidate, other: Mapping[str, str]) -> Candidate:
        """The same explanation in the other module, where that can have it."""
        module, _, local = candidate.id.partition(".")
        there = f"{other.get(module)}.{local}"
        return next((c for c in self.bench.candidates if c.id == there), candidate)

    def _alike(self, fitted: Fitted) -> list[tuple[str, str]]:
        """Pairs of modules with the same parameters."""
        own: dict[str, set[str]] = {}
        for name in fitted.values:
            module, _, local = name.partition(".")
            own.setdefault(module, set()).add(local)
        pairs = itertools.combinations(own, 2)
        # A gain of a sensor that is not there reaches nothing, so one set may hold the other.
        return [(a, b) for a, b in pairs if len(own[a] & own[b]) > 1]

    def trial(
        self,
        on: Fitted | None,
        joined: tuple[Candidate, ...],
        scattered: int = limits.SCATTERED,
        evaluations: int = limits.TRIAL_EVALUATIONS,
        descended: int = limits.DESCENDED,
    ) -> Fitted:
        """Fit a model; what `on` knows is where starts are near."""
        fitter, judged, starts = self._begun(on, joined)
        basis = judged.basis()
        stated = [fitter.stated(at) for at in starts] if on is not None else []
        random = np.random.default_rng(len(joined))
        starts += [fitter.ahead(at, judged, basis) for at in _near_null(fitter, on, starts)]
        base = list(starts)
        for i in range(scattered):
            starts.append(fitter.scattered(base[i % len(base)], random, limits.SCATTER))
        groups = ((starts, descended), (stated, 1))
        begun = [a for g, most in groups for a in _cheapest(fitter, g, most, judged, basis)]
        near = [fitter.descend(at, judged, basis, evaluations) for at in begun]
        if not near:
            return replace(self._hopeless(fitter, judged), joined=joined)
        best = min(near, key=lambda at: fitter.cost(at, judged, basis))
        try:
            return fitter.finish(best, judged, evaluations if descended > 1 else 1, 1)
        except RanAway:  # with errors of sensors as they are seen now
            return replace(self._hopeless(fitter, judged), joined=joined)

    def _begun(
        self, on: Fitted | None, joined: tuple[Candidate, ...]
    ) -> tuple[Fitter, Judged, list[Array]]:
        """What a trial is fitted with, how it is judged, and where it starts."""
        known = on.values if on is not None else {}
        new = [c for c in joined if on is None or c.id not in on.ids]
        fitter = Fitter(self.bench, joined, dict(self._fixed(on, joined)))
        noise = on.noise if on is not None else self._first_noise()
        judged = replace(self.judged, noise=noise)
        if on is not None:
            judged = replace(judged, slow=on.slow, drift=on.drift)
        return fitter, judged, [fitter.vector({**known, **s}) for s in self.starts(on, new)]

    def glance(self, on: Fitted, joined: tuple[Candidate, ...]) -> float:
        """What a trial promises to gain: two steps of the model made linear, from near its null."""
        fitter, judged, starts = self._begun(on, joined)
        basis = judged.basis()
        first = [_stepped(fitter, at, judged, basis) for at in _near_null(fitter, on, starts)]
        _, at = min(first, key=lambda step: step[0])
        least, _ = _stepped(fitter, at, judged, basis)
        return -least - price_of(replace(on, joined=joined), self.news(on))

    def linear(self, fitted: Fitted) -> tuple[Array, Array]:
        """Weighted errors and strains of a model where it stands, shape (rows,), and their slopes
        by its free values, shape (rows, values)."""
        fitter, judged, _ = self._begun(fitted, fitted.joined)
        return fitter.residual(fitter.vector(fitted.values), judged, judged.basis())

    def changes(self, on: Fitted, candidate: Candidate) -> Iterator[tuple[Array, Array, Array]]:
        """What a candidate changes in weighted errors from each of its starts, near its null.

        Shape (errors, strengths), per step that matters, and between how many such steps from
        their null the strengths may lie. Where it runs away there is nothing to tell.
        """
        fitter, judged, starts = self._begun(on, (*on.joined, candidate))
        basis = judged.basis()
        for at in _near_null(fitter, on, starts):
            with contextlib.suppress(RanAway):
                yield fitter.changes(at, judged, basis, candidate)

    def promise(self, on: Fitted, candidates: Sequence[Candidate]) -> bool:
        """Does an explanation promise something, though what is left looks like noise?

        What acts now and then, or moves readings by less than their noise, leaves no pattern.
        """
        fitter, judged, _ = self._begun(on, on.joined)
        before = -fitter.cost(fitter.vector(on.values), judged, judged.basis())
        before -= price_of(on, self.news(on))
        least = before + limits.HOPELESS * needed(len(candidates))
        with ThreadPoolExecutor(self.workers) as pool:
            seen = pool.map(lambda c: self.glance(on, (*on.joined, c)), candidates)
            return any(glance > least for glance in seen)

    def polished(self, fitted: Fitted) -> Fitted:
        """The same, fitted to the end, or as far as the model does not run away."""
        fitter = Fitter(self.bench, fitted.joined, self.kept(fitted))
        judged = replace(self.judged, noise=fitted.noise, slow=fitted.slow, drift=fitted.drift)
        for _ in range(limits.POLISHES):
            with contextlib.suppress(RanAway):
                drift = moved_again(
                    judged.drift, self.bench, fitted.ids, fitted.values, fitted.inputs
                )
                judged = replace(judged, drift=drift)
            try:
                fitted = fitter.finish(fitter.vector(fitted.values), judged, common.THOROUGH, 2)
            except RanAway:
                return fitted
            judged = replace(judged, noise=fitted.noise, slow=fitted.slow)
        return fitted

    def trials(self, tasks: Sequence[Task], plain: Fitted) -> list[Fitted]:
        """Fit many models: on each with explanations those that promise something at a glance."""
        by_model: dict[tuple[str, ...], list[Task]] = {}
        for task in tasks:
            by_model.setdefault(task[0].ids, []).append(task)
        with ThreadPoolExecutor(self.workers) as pool:
            promising: list[Task] = []
            for ids, members in by_model.items():
                if ids:
                    seen = list(pool.map(lambda t: self.glance(*t), members))
                    order = sorted(range(len(members)), key=lambda i: -seen[i])
                    promising += [members[i] for i in order[: limits.PROMISING]]
                else:
                    promising += members
            return list(pool.map(lambda t: self.trial(*t), promising))

    def ranked(self, tasks: Sequence[Task], plain: Fitted) -> list[Fitted]:
        """Trials, best first; what is pressed to an end of its range stands for something else.

        Unless for want of steps: the best of those are fitted to the end before they are dropped.
        """
        tried = sorted(self.trials(tasks, plain), key=lambda f: -self.standing(f, plain))
        ended = [self.polished(f) if f.pressed else f for f in tried[: limits.BEAM]]
        free = [f for f in (*ended, *tried[limits.BEAM :]) if not f.pressed]
        return sorted(free, key=lambda f: -self.standing(f, plain))

    def refined(self, models: Sequence[Fitted], plain: Fitted) -> list[Fitted]:
        """Models fitted to the end, best first."""
        with ThreadPoolExecutor(self.workers) as pool:
            fitted = [f for f in pool.map(self.polished, models) if not f.pressed]
        return sorted(fitted, key=lambda f: -self.standing(f, plain))

    def standing(self, fitted: Fitted, plain: Fitted) -> float:
        """What a model gains over the plain one where both are counted by the plain one's memory.

        Models of one level stand in this order: by what they leave, not by how it looks.
        """
        gained = (
            plain.negative_log_prior
            - fitted.negative_log_prior
            - price_of(fitted, self.news(plain))
        )
        for name, noise in fitted.noise.items():
            before = plain.noise[name]
            count = self.samples[name] / before.memory
            gained += count * float(np.log(before.spread / noise.spread))
        return gained

    def gain(self, after: Fitted, before: Fitted) -> float:
        """Gain in log likelihood over another model, prices of both counted."""
        found = sum(gain(before.noise[n], after.noise[n], self.samples[n]) for n in before.noise)
        found += before.negative_log_prior - after.negative_log_prior
        return found - price_of(after, self.news(after)) + price_of(before, self.news(after))

    def news(self, fitted: Fitted) -> float:
        """Independent pieces of news in the recording, by what a model leaves."""
        return sum(self.samples[n] / noise.memory for n, noise in fitted.noise.items())

    def _first_noise(self) -> dict[str, Noise]:
        measured = self.bench.record.measured
        return {n: Noise(0.3 * float(np.nanstd(v)) + 1e-12, 10.0) for n, v in measured.items()}

    def kept(self, fitted: Fitted) -> dict[str, float]:
        """Typical values that parameters of a model stay at."""
        fixed = {u.id for c in fitted.joined for u in c.unknowns if u.fixed}
        return {n: v for n, v in fitted.values.items() if n in fixed}

    def _fixed(self, on: Fitted | None, joined: Sequence[Candidate]) -> Iterable[tuple[str, float]]:
        """Typical values that parameters stay at."""
        for unknown in (u for c in joined for u in c.unknowns if u.fixed):
            if on is not None and unknown.id in on.values:
                yield unknown.id, on.values[unknown.id]
                continue
            course = self._course(on, unknown.driver or "time")
            if len(unknown.quantiles) == 2:
                low, high = np.nanquantile(course, unknown.quantiles)
                yield unknown.id, 0.5 * float(high - low)
            else:
                yield unknown.id, float(np.nanquantile(course, unknown.quantiles or MEDIAN)[0])

    def _course(self, on: Fitted | None, name: str) -> Array:
        values = on.values if on is not None else {}
        ids, inputs = (on.ids, on.inputs) if on is not None else ((), self.bench.record.inputs)
        return self.bench.trajectory(ids, values, name, inputs)

    def starts(self, on: Fitted | None, new: Sequence[Candidate]) -> list[Mapping[str, float]]:
        """Every combination of the starts of new unknowns, by id."""
        names, options = [], []
        for unknown in (u for c in new for u in c.unknowns if not u.fixed):
            names.append(unknown.id)
            if unknown.quantiles:
                course = self._course(on, unknown.driver or "time")
                options.append(np.nanquantile(course, unknown.quantiles).tolist())
            else:
                options.append(list(unknown.starts) or [unknown.null or 0.0])
        return [dict(zip(names, chosen, strict=True)) for chosen in itertools.product(*options)]

    def _hopeless(self, fitter: Fitter, judged: Judged) -> Fitted:
        measured = self.bench.record.measured
        noise = {n: Noise(10.0 * float(np.nanstd(v)) + 1e-12, 1.0) for n, v in measured.items()}
        errors = {n: np.full(len(v), np.nan) for n, v in measured.items()}
        values, inputs = fitter.values(fitter.vector({})), self.bench.record.inputs
        empty = np.zeros((0, 0))
        drift = judged.drift
        return Fitted(
            (), values, fitter.free, noise, errors, 0.0, empty, judged.slow, inputs, drift
        )


def _near_null(fitter: Fitter, on: Fitted | None, starts: Sequence[Array]) -> list[Array]:
    """Starts with all new strengths nearly at their null, each once."""
    known = on.values if on is not None else {}
    near = [fitter.gentle(at, known) for at in starts]
    return list({at.tobytes(): at for at in near}.values())


def _cheapest(
    fitter: Fitter, starts: Sequence[Array], most: int, judged: Judged, basis: Array
) -> Sequence[Array]:
    """The best starts of all that can be simulated."""
    ranked = sorted((fitter.cost(at, judged, basis), i) for i, at in enumerate(starts))
    return [starts[i] for cost, i in ranked[:most] if np.isfinite(cost)]


def _stepped(fitter: Fitter, at: Array, judged: Judged, basis: Array) -> tuple[float, Array]:
    """A cheaper point on the way to the optimum of the model made linear, with its cost."""
    far, here = fitter.ahead(at, judged, basis), fitter.cost(at, judged, basis)
    for share in limits.STEP_SHARES:
        point = at + share * (far - at)
        cost = fitter.cost(point, judged, basis)
        if cost < here:
            return cost, point
    return here, at
