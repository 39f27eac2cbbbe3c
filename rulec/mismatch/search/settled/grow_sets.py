"""Grow sets of explanations from the best ones, refit each, and compare them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from rulec_runtime.report.text import counted

from rulec.effects.candidate import TIME, Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.operating_state_means import rows_of_states
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import InitialCandidate, with_open_references
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import Evidence, Term
from rulec.mismatch.search.refit import Model, refitted
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.settled.nameless import beside, holds, nameless, terms
from rulec.mismatch.search.settled.scan import (
    Found,
    alike_faults,
    columns,
    id_of,
    intermittent_faults,
    joined,
    periods_again,
    scan,
)
from rulec.mismatch.search.settled.switching_term import with_set_points
from rulec.mismatch.search.tolerance import Tolerance

Names = frozenset[str]
"""Names of candidates, with marks for those that begin, come and go or grow, and of terms."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Posterior:
    """Models of the refitted sets, their log odds, nats, and their probabilities."""

    geometry: Evidence
    models: Mapping[Names, Model]
    odds: Mapping[Names, float]
    sets: Mapping[Names, float]

    @property
    def settled(self) -> Geometry:
        """The geometry, where it is that of settled points."""
        assert isinstance(self.geometry, Geometry)
        return self.geometry

    @property
    def best(self) -> Names:
        """The most probable set."""
        return max(self.sets, key=lambda names: (self.sets[names], self.odds[names], sorted(names)))

    @property
    def told(self) -> Names:
        """The most probable set; the empty one, where that is not unlikely."""
        return frozenset() if self.nothing >= common.MENTIONED else self.best

    @property
    def nothing(self) -> float:
        """Probability that no effect is missing."""
        return self.sets[frozenset()]

    @cached_property
    def tolerance(self) -> Tolerance:
        """How far readings may be off under the set `told`."""
        return self._tolerance(self.told)

    def _tolerance(self, names: Names) -> Tolerance:
        return Tolerance(self.geometry, self.models[names])

    @property
    def _likely(self) -> dict[Names, float]:
        return {n: p for n, p in self.sets.items() if n and p > limits.LIKELY_SET}

    @cached_property
    def within(self) -> tuple[Names, ...]:
        """Likely sets of terms that are within the errors of laws and sensors."""
        return tuple(n for n in self._likely if n == self._tolerance(n).within)

    @property
    def unseen(self) -> float:
        """Probability that no missing effect shows.

        It includes sets of terms within the errors of laws and sensors and, unless another set is
        likely enough to be mentioned, those that move no reading by more than these errors.
        """
        others = {n: p for n, p in self._likely.items() if n not in self.within}
        nothing = self.nothing + sum(self._likely[names] for names in self.within)
        if max(others.values(), default=0.0) >= common.MENTIONED:
            return nothing
        shown = (self._tolerance(n).shows for n in others)
        hidden = (p * (1.0 - share) for p, share in zip(others.values(), shown, strict=True))
        return nothing + sum(hidden)

    @property
    def names(self) -> dict[str, float]:
        """Probability of each explanation, as the sum over the sets that contain it."""
        sets = self.sets
        every = sorted({name for names in sets for name in names})
        return {name: sum(p for names, p in sets.items() if name in names) for name in every}


@dataclass(frozen=True)
class Search:
    """Refits sets of explanations and keeps the results; `points` are all settled ones."""

    geometry: Evidence
    points: Rows | None = None
    alike: dict[str, frozenset[str]] = field(default_factory=dict)
    models: dict[Names, Model] = field(default_factory=dict)
    odds: dict[Names, float] = field(default_factory=dict)

    def refit(
        self, setting: Configuration, near: Model | None, own: tuple[Term, ...] = ()
    ) -> Model:
        """Refit a set from a similar one."""
        return refitted(self.geometry, setting, near, own)

    def keep(self, names: Names, model: Model) -> None:
        """Keep a model if it is the best one of its set so far."""
        odds = self.score(model)
        if odds > self.odds.get(names, -np.inf):
            self.models[names], self.odds[names] = model, odds

    def score(self, model: Model) -> float:
        """Evidence plus prior log odds, nats."""
        setting = model.setting
        number = max(len({c.id for c in self.geometry.candidates}), 1)
        prior = sum(
            limits.MISSING_ODDS + limits.SORT_ODDS[c.sort] - np.log(number) for c in setting.joined
        )
        prior -= limits.COMMON * sum(bool(c.members) for c in setting.joined)
        ends = sum(2 * len(c.periods) - 1 for c in setting.courses)
        prior -= ends * float(np.log(limits.ONSETS))
        places = max(self.geometry.terms, 1)
        prior += len(model.terms) * (limits.MISSING_ODDS + limits.TERM_ODDS - float(np.log(places)))
        prior -= sum(term.basis.price for term in model.terms)
        return model.evidence + float(prior)

    @property
    def every(self) -> Rows:
        """All settled points."""
        assert self.points is not None
        return self.points

    @property
    def settled(self) -> Geometry:
        """The geometry, where it is that of settled points."""
        assert isinstance(self.geometry, Geometry)
        return self.geometry

    @property
    def likeliest(self) -> Names:
        """The set of the largest log odds."""
        return max(self.odds, key=lambda names: (self.odds[names], sorted(names)))

    def posterior(self) -> Posterior:
        """The posterior over all sets."""
        return posterior(self.geometry, self.models, self.odds)


def posterior(
    geometry: Evidence, models: Mapping[Names, Model], odds: Mapping[Names, float]
) -> Posterior:
    """The posterior over refitted sets."""
    weight = np.exp(np.array(list(odds.values())) - max(odds.values()))
    sets = dict(zip(odds, (weight / weight.sum()).tolist(), strict=True))
    return Posterior(geometry, dict(models), dict(odds), sets)


def _intermittent(search: Search, model: Model) -> list[Found]:
    time = search.settled.rows.system.data.time
    return intermittent_faults(search.every, model, search.alike, time)


def begun(every: Rows) -> Search:
    """A search that has refitted the plain model to means of operating states."""
    search = _plain(every, np.zeros(0))
    cuts = _ends(_intermittent(search, search.models[frozenset()]))
    search = _plain(every, cuts) if len(cuts) else search
    search.alike.update(alike_faults(columns(search.settled, search.models[frozenset()], {})))
    return search


def _plain(every: Rows, cuts: np.ndarray) -> Search:
    states = rows_of_states(every.system, cuts)
    search = Search(Geometry(states if len(states) else every), every)
    search.keep(frozenset(), search.refit(Configuration(), None))
    return search


def _ends(found: Sequence[Found]) -> np.ndarray:
    """Ends of the periods, s, of the fault that gains most: a mean across one would blur it."""
    worth = [f for f in found if f.gain > limits.WORTH_A_CUT]
    best = max(worth, key=lambda f: f.gain, default=None)
    courses = [column.course for column, _ in best.starts] if best else []
    spans = [span for course in courses if course for span in course.periods]
    return np.unique(
        [end for span in spans for end in (span.since, np.nextafter(span.until, np.inf))]
    )


def explain(every: Rows, progress: Progress) -> Posterior:
    """Search for the sets of explanations of a recording."""
    search = begun(every)
    grown(search, progress, (_refine_onsets, _grow, prune))
    _refit_switching_terms(search)
    _refit_candidates_for_terms(search)
    return search.posterior()


def grown(
    search: Search,
    progress: Progress,
    steps: Sequence[Callable[[Search, Names], None]],
    *,
    apart: bool = False,
) -> None:
    """Grow the best sets, each by all steps, until no new one is among the best.

    If `apart`, sets with and without terms are grown separately.
    """
    done: set[Names] = set()
    for number in range(1, limits.SEARCH_ROUNDS + 1):
        best = sorted(search.odds, key=lambda names: -search.odds[names])
        kinds = [bool(search.models[names].terms) and apart for names in best]
        own = ([n for n, k in zip(best, kinds, strict=True) if k is kind] for kind in (False, True))
        todo = [n for kind in own for n in kind[: limits.SETS_GROWN] if n not in done]
        if not todo:
            break
        for names in todo:
            done.add(names)
            tried = counted(len(search.odds), "combination")
            progress(f"round {number}: {tried} tested")
            for step in steps:
                step(search, names)


def _refit_switching_terms(search: Search) -> None:
    """In the best sets, try a term that changes with set points in the place of each fault that
    comes and goes."""
    for names in sorted(search.odds, key=lambda n: -search.odds[n])[: limits.SETS_SWITCHED]:
        model = search.models[names]
        for course in model.setting.courses:
            fault = model.setting.candidate_of(course)
            rest = without(names, fault)
            if course.grows or rest not in search.models:
                continue
            place, near = (fault.module, fault.place), search.models[rest]
            for term in with_set_points(search.every, search.settled, model, course, place):
                own = (*near.terms, term)
                search.keep(rest | {term.name}, search.refit(near.setting, near, own))


def _refit_candidates_for_terms(search: Search) -> None:
    """Refit effects of the catalogue in the place of each term of the best set, to report by how
    much they lost."""
    names = search.likeliest
    for term in search.models[names].terms:
        rest = names - {term.name}
        ids = {c.id for c in _in_its_place(search.settled.rows.system, term)}
        if rest not in search.models or not ids:
            continue
        model = search.models[rest]
        own = columns(search.settled, model, search.alike)
        own = [c for c in own if not holds(model.terms, c.rows)]
        for one in scan(search.settled, model, own, search.alike, common.LOST_TOLD, ids):
            if len(one.starts) == 1 and rest | one.names not in search.odds:
                _join(search, rest, one)


def _in_its_place(system: System, term: Term) -> list[Candidate]:
    """Effects at the place of a term; only those with its driver, if there are any."""
    place = (term.changed.module, term.changed.place)
    here = [c for c in system.candidates if (c.module, c.place) == place]
    same = [c for c in here if term.driver in c.drivers.values()]
    return same if same and term.driver != TIME else here


def _grow(search: Search, names: Names) -> None:
    """Refit a set with the explanations that gain most beside it."""
    if len(names) >= limits.LARGEST_SET:
        return
    geometry, model = search.settled, search.models[names]
    every = columns(geometry, model, search.alike)
    every = [c for c in every if not holds(model.terms, c.rows)]
    found = scan(geometry, model, every, search.alike, limits.SETS_REFITTED)
    # Each from all shapes that some view of the recording found best, by its largest gain.
    new = {one.shapes: one for one in reversed(found) if names | one.names not in search.odds}
    for one in new.values():
        _join(search, names, one)
    # A fault that begins may also come and go: the likelier model is kept.
    for one in _intermittent(search, model):
        _join(search, names, one)
    join_terms(search, names, terms(geometry, model))


def join_terms(search: Search, names: Names, every: Sequence[Term]) -> None:
    """Refit a set with the terms without a name that gain most beside it."""
    model = search.models[names]
    for gain, term in nameless(search.geometry, model, beside(model, every), limits.TERMS_REFITTED):
        if gain > limits.WORTH_A_REFIT and names | {term.name} not in search.odds:
            own = (*model.terms, term)
            search.keep(names | {term.name}, search.refit(model.setting, model, own))


def _join(search: Search, names: Names, found: Found) -> None:
    """Refit a set with columns joined, with usual and with free reference conditions; the better
    model is kept."""
    model, system = search.models[names], search.settled.rows.system
    setting = joined(model.setting, found.starts, system.data.time)
    new = [column.candidate for column, _ in found.starts]
    for way in (setting, _with_open_references(system, setting, new)):
        if way is not None:
            with contextlib.suppress(np.linalg.LinAlgError):
                search.keep(names | found.names, search.refit(way, model, model.terms))


def _with_open_references(
    system: System, setting: Configuration, new: Sequence[Candidate]
) -> Configuration | None:
    """A setting whose laws have free reference conditions; None where none of them has any."""
    there = None
    for candidate in new:
        values = {u.id: setting.values[u.id] for u in candidate.unknowns if u.id in setting.values}
        trial = InitialCandidate(candidate=candidate, values=values, fixed=setting.fixed, gain=0.0)
        opened = with_open_references(system, trial)
        if opened is not None and not setting.in_periods & {u.id for u in candidate.unknowns}:
            bare = (there or setting).leaving(candidate.id)
            there = bare.joining(opened.candidate, opened.values, opened.fixed)
    return there


def prune(search: Search, names: Names) -> None:
    """Refit a set without each of its members: from here even a known set may be refitted better,
    as its periods and values were found without the others."""
    model = search.models[names]
    if len(names) < 2:
        return
    for candidate in model.setting.joined:
        with contextlib.suppress(np.linalg.LinAlgError):
            less = search.refit(model.setting.leaving(candidate.id), model, model.terms)
            search.keep(without(names, candidate), less)
    for term in model.terms:
        own = tuple(t for t in model.terms if t is not term)
        search.keep(names - {term.name}, search.refit(model.setting, model, own))


def without(names: Names, candidate: Candidate) -> Names:
    """A set without one candidate, whatever its course."""
    return frozenset(n for n in names if id_of(n) != candidate.id)


def _refine_onsets(search: Search, names: Names) -> None:
    """Find periods again beside all else, and move onsets while that is likelier: the onsets tried
    at first lie far apart."""
    time = search.settled.rows.system.data.time
    setting = search.models[names].setting
    for course in (c for c in setting.courses if not c.grows):
        again = periods_again(search.every, setting, setting.candidate_of(course), time)
        if again is not None:
            ((column, _),) = again.starts
            model = search.models[names]
            there = joined(setting.leaving(column.candidate.id), again.starts, time)
            search.keep(names, search.refit(there, model, model.terms))
    for number, course in enumerate(search.models[names].setting.courses):
        steps = (*limits.ONSET_STEPS, *(limits.GROWING_STEPS if course.grows else ()))
        for step in steps if len(course.periods) == 1 else ():
            for way in (-step, step):
                while _moved(search, names, number, way, time):
                    pass


def _moved(search: Search, names: Names, number: int, by: float, time: np.ndarray) -> bool:
    """Is an onset `by` points later likelier? A growing fault may begin between two points."""
    model = search.models[names]
    course = model.setting.courses[number]
    since, points = course.periods[0].since, np.arange(len(time), dtype=float)
    at = float(np.interp(since, time, points) if course.grows else np.searchsorted(time, since))
    if not 0 < at + by < len(time) - course.grows or course.segment[-1] < 0:
        return False
    courses = list(model.setting.courses)
    courses[number] = course.since(float(np.interp(at + by, points, time)), time)
    before = search.odds[names]
    setting = replace(model.setting, courses=tuple(courses))
    search.keep(names, search.refit(setting, model, model.terms))
    return search.odds[names] > before
