"""The search on means of operating states, and the most probable set refitted to all points.

Rows are means per operating state and block of time, and every law may have an error of form. All
single explanations and pairs are scanned, and the best sets are refitted.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Candidate
from rulec.language.expression import Rejected
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import name_of
from rulec.mismatch.evidence.prior import priors_of
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence
from rulec.mismatch.evidence.steady.fit import Fitted, fit, variance_inflation_of
from rulec.mismatch.evidence.steady.operating_state_means import rows_of_states
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    Suspect,
    screen,
    suspect_at,
    ways_at,
)
from rulec.mismatch.evidence.term import Term
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_at_points import branches_of, curve_of, elsewhere, lost_to
from rulec.mismatch.search.curve_found import Accepted, CurveFound
from rulec.mismatch.search.grow_sets import Progress, Search, grow, grow_terms, grown, prune
from rulec.mismatch.search.intermittent_fault import with_refined_onset
from rulec.mismatch.search.latent_input import free_course, switched_course
from rulec.mismatch.search.posterior import Posterior, accepted_of, reported_names, reported_setting
from rulec.mismatch.search.scan import alike_faults, holds, scan
from rulec.mismatch.search.time_course import (
    coming_and_going,
    ends_of,
    grow_periods,
    refine_onsets,
    refit_switching_terms,
)


def explain(every: Rows, progress: Progress) -> Posterior:
    """Search for the sets of explanations of a recording by all its settled points."""
    search = begun(every)
    grown(search, progress, (refine_onsets, grow, grow_periods, grow_terms, prune))
    refit_switching_terms(search)
    _refit_candidates_for_terms(search)
    return search.posterior()


def begun(every: Rows) -> Search:
    """A search that has refitted the plain model to means of operating states."""
    search = _plain(every, np.zeros(0))
    plain = search.models[frozenset()]
    cuts = ends_of(coming_and_going(search, plain))
    if len(cuts):
        search = _plain(every, cuts)
        plain = search.models[frozenset()]
    evidence = search.evidence
    return replace(search, alike=alike_faults(evidence.columns(plain.point, evidence.candidates)))


def _plain(every: Rows, cuts: Array) -> Search:
    states = rows_of_states(every.system, cuts)
    search = Search(SteadyEvidence(states if len(states) else every, every))
    search.keep(frozenset(), search.refit(Configuration(), None))
    return search


def _refit_candidates_for_terms(search: Search) -> None:
    """Refit effects of the catalogue in the place of each term of the best set, to report by how
    much they lost."""
    names, evidence = search.likeliest, search.evidence
    for term in search.models[names].terms:
        rest, here = names - {term.name}, _effects_at(evidence.candidates, term)
        if rest not in search.models or not here:
            continue
        model = search.models[rest]
        shut_out = search.shut_out(model)
        every = evidence.columns(model.point, (c for c in here if c.id not in shut_out))
        every = [c for c in every if not holds(model.terms, c.rows)]
        for one in scan(evidence, model, every, search.alike, common.LOST_TOLD):
            if len(one.starts) == 1 and rest | one.names not in search.odds:
                for more, begin in evidence.starting_points(model.setting, every, [one]):
                    search.join(rest, more, begin)


def _effects_at(every: Sequence[Candidate], term: Term) -> list[Candidate]:
    """Effects at the place of a term; only those with its driver, if there are any."""
    place = (term.changed.module, term.changed.place)
    here = [c for c in every if (c.module, c.place) == place]
    same = [c for c in here if term.driver in c.drivers.values()]
    return same if same and term.driver != TIME else here


@dataclass(frozen=True)
class Found:
    """The model fitted to all points, its explanations, all sets that were compared, and all terms
    without a name of the best set, those within the accuracy of laws too."""

    fitted: Fitted
    accepted: tuple[Accepted, ...]
    posterior: Posterior
    curves: tuple[CurveFound, ...]


def search(rows: Rows, progress: Progress) -> Found:
    """Find the sets of explanations that fit a recording, and fit the most probable one."""
    progress("taking means of operating states")
    posterior = explain(rows, progress)
    progress("refitting the most probable explanation to all settled points")
    model = posterior.models[posterior.selected]
    fitted, candidates = _on_all_points(rows, posterior)
    curves = {term.name: curve_of(posterior, term) for term in model.terms}
    for term in (t for t in model.terms if t.name in candidates):
        curve, candidate = curves[term.name], candidates[term.name]
        curves[term.name] = replace(
            curve,
            branches=branches_of(fitted, candidate, curve, term.basis, model.size_of(term)),
            elsewhere=elsewhere(posterior, term),
            lost=lost_to(posterior, term),
        )
    accepted = tuple(
        replace(accepted_of(posterior, name, c), curve=curves.get(name))
        for name, c in candidates.items()
    )
    return Found(fitted, accepted, posterior, tuple(curves.values()))


def _on_all_points(rows: Rows, posterior: Posterior) -> tuple[Fitted, dict[str, Candidate]]:
    """The model with terms as courses and curves; candidates by their names in the set."""
    model, reported = posterior.models[posterior.selected], reported_names(posterior)
    setting = reported_setting(posterior)
    setting = replace(setting, priors=priors_of(model.prior, setting))
    fitted = _fitted(rows, setting.at_points(rows.system.data.time))
    for course in fitted.setting.courses:
        fitted = with_refined_onset(fitted, course.unknown)
    fitted = confirmed(fitted)
    names = {name_of(fitted.setting, c): c for c in fitted.setting.joined}
    for term in (t for t in model.terms if t.name in reported):
        there = with_term(fitted, term)
        if there is not None:
            fitted = there
            names[term.name] = fitted.setting.joined[-1]
    return fitted, names


def confirmed(fitted: Fitted) -> Fitted:
    """The model without explanations that vanish where laws are exact, the weakest first: beside
    errors of form an effect may only refine what these leave."""
    while fitted.setting.joined:
        sizes = {c.id: _size(fitted, c) for c in fitted.setting.joined}
        weakest = min(sizes, key=lambda id_: sizes[id_])
        if sizes[weakest] > common.NORMAL_95:
            break
        fitted = _fitted(fitted.rows, fitted.setting.leaving(weakest))
    return fitted


def _size(fitted: Fitted, candidate: Candidate) -> float:
    """Largest amplitude of a candidate, in its standard uncertainty."""
    null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
    own = [(name, null.get(name.partition("#")[0])) for name in fitted.setting.free_unknowns()]
    values = fitted.setting.values
    sizes = [abs(values[n] - start) / fitted.u(n) for n, start in own if start is not None]
    return max(sizes, default=np.inf)


def _fitted(rows: Rows, setting: Configuration) -> Fitted:
    """Fit twice, the second time with the correlation of neighbours taken into account."""
    used = rows.system.data.open
    first = fit(rows, setting, used)
    return fit(rows, first.setting, used, variance_inflation=variance_inflation_of(first))


def with_term(fitted: Fitted, term: Term) -> Fitted | None:
    """Join a term without a name as a course in time, or as a curve over its driver."""
    suspect = _suspect(fitted, term)
    if suspect is None:
        return None
    if term.basis.says:
        there = term.basis.at(fitted.rows.system.data.time)[:, 0] > 0.0
        return _with_trial(fitted, switched_course(fitted, suspect.location, there))
    if term.driver == TIME:
        return _with_trial(fitted, free_course(fitted, suspect))
    for most in limits.BANDS:
        # Beside another curve its equation may be too long; fewer pieces make it shorter.
        with contextlib.suppress(Rejected):
            curve = _curve_at(fitted, suspect.location.id, term.driver, most)
            found = screen(fitted, [curve]) if curve is not None else []
            return _with_trial(fitted, found[0]) if found else None
    return None


def _curve_at(fitted: Fitted, location: str, name: str, most: int) -> Candidate | None:
    """A piecewise linear curve of at most `most` pieces over a reading; None where the readings are
    too close together.

    Pieces within the noise of a reading, as at a few operating points, would only sort that noise.

    Source: generalised additive models (Hastie, Tibshirani 1986).
    """
    data = fitted.rows.system.data
    values = data.values[name][data.open]
    least = limits.BAND_WIDTH * float(np.nanmedian(data.noise[name][data.open]))
    for parts in (n for n in limits.BANDS if n <= most):
        knots = np.nanquantile(values, np.linspace(0.0, 1.0, parts + 1))
        if float(np.min(np.diff(knots))) >= least:
            # All pieces together are a constant, which base values may already contain.
            pieces = [i for i in range(parts + 1) if i != parts // 2]
            features = tuple(f"{name}~{i}/{parts}" for i in pieces)
            return fitted.rows.system.builder.free_form(location, features)
    return None


def _with_trial(fitted: Fitted, trial: InitialCandidate) -> Fitted:
    return _fitted(fitted.rows, trial.joined_to(fitted.setting))


def _suspect(fitted: Fitted, term: Term) -> Suspect | None:
    """The place of a term, or the parameter of the law there, with the error that explains most."""
    ways = ways_at(fitted, fitted.rows.system.builder.location_by_id[term.location])
    own = (suspect_at(fitted, *way) for way in ways if way[0].id == term.changed.id)
    return next(own, None)
