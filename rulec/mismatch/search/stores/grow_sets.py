"""Grow sets of explanations of a plant that stores from the best ones."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from operator import itemgetter

import numpy as np
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.stores.fit import Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise, no_drift
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import Term, term_with
from rulec.mismatch.search.refit import Model, refitted
from rulec.mismatch.search.settled.grow_sets import (
    Names,
    Posterior,
    Progress,
    Search,
    grown,
    join_terms,
    prune,
)
from rulec.mismatch.search.settled.scan import Column, Found, joined, scan
from rulec.mismatch.search.stores.fitted_curve import Place, drivers_of, place_over, spots_of
from rulec.mismatch.search.stores.geometry import StoresGeometry, usual

# Starting values for the refit of a plant that stores, by least squares of simulation errors.
#
# Correlated errors of a model that is far off make a rough likelihood; here errors count as
# independent.


def from_afar(
    bench: SimulationProblem,
    setting: Configuration,
    evaluations: int = limits.EVALUATIONS,
    fits: int = limits.FITS_FROM_AFAR,
) -> Configuration:
    """Values of least simulation errors near a setting, as far as the evaluations lead."""
    fitter = Fitter(bench, setting.joined, setting.fixed)
    at = fitter.vector(setting.values)
    measured = bench.record.measured
    noise = {n: limits.FAR_OFF * float(np.nanstd(v)) + 1e-12 for n, v in measured.items()}
    for _ in range(fits):
        judged = _judged(bench, noise)
        at = fitter.descend(at, judged, judged.basis(), evaluations)
        with contextlib.suppress(RanAway):
            errors, _ = fitter.errors(at, judged)
            noise = {n: float(np.sqrt(np.mean(e[bench.known[n]] ** 2))) for n, e in errors.items()}
    values = fitter.values(at)
    return replace(setting, values={n: values[n] for n in fitter.free})


def nearest(bench: SimulationProblem, every: Sequence[Configuration]) -> Configuration | None:
    """The setting with the smallest residuals, by the sum of their logarithms over readings, of
    those that do not run away."""
    found = list[tuple[float, Configuration]]()
    for setting in every:
        fitter = Fitter(bench, setting.joined, setting.fixed)
        at = fitter.vector(setting.values)
        values = fitter.values(at)
        there = replace(setting, values={n: values[n] for n in fitter.free})
        with contextlib.suppress(RanAway), np.errstate(all="ignore"):
            errors, _ = fitter.errors(at, _judged(bench, dict.fromkeys(bench.signals, 1.0)))
            left = [errors[n][known] for n, known in bench.known.items()]
            size = sum(0.5 * len(own) * float(np.log(np.mean(own**2))) for own in left)
            found.append((size, there))
    return min(found, key=lambda one: one[0])[1] if found else None


def _judged(bench: SimulationProblem, noise: dict[str, float]) -> Judged:
    """Weights of independent errors of the given standard deviation."""
    new = {n: Noise(spread, 1.0) for n, spread in noise.items()}
    return Judged(bench.known, new, no_drift(bench), np.zeros(0))


# Terms without a name of a plant that stores: a place that follows a driver by any smooth
# function.


def terms(geometry: StoresGeometry, model: Model) -> list[Term]:
    """Terms for each place and each driver, linearised at a model."""
    bench, found = geometry.bench, list[Term]()
    for driver in drivers_of(bench):
        course = geometry.course(model.setting, driver)[bench.record.open]
        for spot in spots_of(bench):
            place = place_over(spot, driver, course)
            if place is not None:
                found += _terms(geometry, model, place)
    return found


def _terms(geometry: StoresGeometry, model: Model, place: Place) -> Iterator[Term]:
    parts, knots = place.parts(geometry.bench.builder)
    setting = model.setting
    for part in parts:
        own = {u.id: knots[u.id] for u in part.unknowns if u.fixed}
        nothing = {u.id: 0.0 for u in part.unknowns if not u.fixed}
        setting = setting.joining(part, nothing, own)
    coefficients = [u.id for part in parts for u in part.unknowns if not u.fixed]
    slopes = geometry.simulated(setting, coefficients)[1] @ place.bends
    for basis in place.bases():
        columns, spot = slopes @ basis.at(place.knots), place.spot
        term = term_with(columns, spot.id, spot, place.driver, basis, np.zeros(0))
        if term is not None:
            yield term


def columns(geometry: StoresGeometry, model: Model, of: Set[str] | None = None) -> list[Column]:
    """Columns for each amplitude of each candidate at several shapes: its slope near its null and,
    as laws bend, its secant to each usual strength.

    Candidates are limited to the ids `of`.
    """
    found: list[Column] = []
    taken = {(c.name, c.place, m) for c in model.setting.joined for m in c.modules}
    plain, _ = geometry.simulated(model.setting)
    for candidate in geometry.candidates:
        if of is not None and candidate.id not in of:
            continue
        if taken & {(candidate.name, candidate.place, m) for m in candidate.modules}:
            continue
        amplitudes = amplitudes_of(candidate)
        null = {u.id: n for u, n in amplitudes.items()}
        near = {u.id: n + common.GENTLE * (usual(u) - n) for u, n in amplitudes.items()}
        fixed = geometry.references(model.setting, candidate)
        for shape in geometry.starts(model.setting, candidate):
            start = {**null, **shape}
            there = model.setting.joining(candidate, {**near, **shape}, fixed)
            _, slopes = geometry.simulated(there, [u.id for u in amplitudes])
            changes = list(zip(amplitudes, slopes.T, strict=True))
            strengths = ((u, s) for u, n in amplitudes.items() for s in u.starts if s != n)
            for unknown, strength in strengths:
                there = model.setting.joining(candidate, {**start, unknown.id: strength}, fixed)
                change = geometry.simulated(there)[0] - plain
                changes.append((unknown, change / (strength - null[unknown.id])))
            found += [
                Column(candidate=candidate, amplitude=u, values=start, fixed=fixed, rows=rows)
                for u, rows in changes
                if np.isfinite(rows).all() and rows.any()
            ]
    return found


def ways(geometry: StoresGeometry, model: Model, every: Sequence[Found]) -> list[Configuration]:
    """Settings from which the refit of a set may start: the best one with predicted strengths, and
    the best ones with usual strengths, with the current and with the stated values of the plant."""
    predicted = [joined(model.setting, found.starts) for found in every]
    new = {c.candidate.id: c.candidate for c, _ in every[0].starts}.values()
    fixed = {c.id: geometry.references(model.setting, c) for c in new}
    shapes = itertools.product(*(geometry.starts(model.setting, c) for c in new))
    signs = {
        tuple((c.amplitude, np.sign(v - (c.amplitude.null or 0.0))) for c, v in found.starts)
        for found in every
    }
    others = []
    for each in itertools.islice(shapes, limits.SHAPES):
        for ahead in signs:
            there, own = model.setting, {u.id: usual(u, sign) for u, sign in ahead}
            for candidate, shape in zip(new, each, strict=True):
                rest = {u.id: usual(u) for u in amplitudes_of(candidate)}
                there = there.joining(candidate, {**shape, **rest}, fixed[candidate.id])
            others.append(replace(there, values={**there.values, **own}))
    # Beside another explanation the values of the plant are reliable.
    stated = [_as_stated(there) for there in others] if not model.setting.joined else []
    best = (nearest(geometry.bench, kind) for kind in (predicted, others, stated))
    return [way for way in best if way is not None]


def _as_stated(setting: Configuration) -> Configuration:
    """A setting with the stated values of the plant."""
    own = {u.id for c in setting.joined for u in c.unknowns}
    return replace(setting, values={n: v for n, v in setting.values.items() if n in own})


def amplitudes_of(candidate: Candidate) -> dict[Unknown, float]:
    """Amplitudes of a candidate with their nulls."""
    return {u: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}


def explain(bench: SimulationProblem, progress: Progress) -> Posterior:
    """Search for the sets of explanations of a recording."""
    search = begun(bench)
    grown(search, progress, (grow, prune), apart=True)
    progress("refitting the likeliest sets, with errors as they are about the best one")
    # A model that is far off has other errors of form and of sensors.
    again = Search(StoresGeometry(bench, search.models[search.likeliest].setting))
    likely = sorted(search.odds, key=lambda names: -search.odds[names])[: limits.SETS_AGAIN]
    for names in dict.fromkeys((*likely, frozenset())):
        model = search.models[names]
        with contextlib.suppress(np.linalg.LinAlgError):
            again.keep(names, again.refit(model.setting, model, model.terms))
    return again.posterior()


def begun(bench: SimulationProblem) -> Search:
    """A search that has refitted the plain model, with errors linearised at that."""
    first = StoresGeometry(bench)
    near = refitted(first, from_afar(bench, Configuration()))
    search = Search(StoresGeometry(bench, near.setting))
    search.keep(frozenset(), search.refit(near.setting, near))
    return search


def grow(search: Search, names: Names, of: Set[str] | None = None) -> None:
    """Refit a set with the explanations that gain most beside it."""
    geometry, model = search.geometry, search.models[names]
    assert isinstance(geometry, StoresGeometry)
    if of is None and len(names) < limits.LARGEST_SET:
        join_terms(search, names, terms(geometry, model))
    if model.terms or len(names) >= limits.DEEPEST:
        # A term is linearised at the model without it: the residual may be its own curvature.
        return
    every = columns(geometry, model, of)
    groups: dict[Names, list[Found]] = {}
    for one in scan(geometry, model, every, {}, limits.SETS_REFITTED):
        groups.setdefault(one.names, []).append(one)
    if not names:
        # Far from a model slopes hardly predict the gain of a large effect.
        for column in every:
            name = frozenset({column.name})
            groups.setdefault(name, [Found(0.0, ((column, usual(column.amplitude)),))])
    tried = []
    for new, found in groups.items():
        if names | new not in search.odds:
            begins = ways(geometry, model, found)
            count = limits.EVALUATIONS_OF_EACH
            near = [from_afar(geometry.bench, way, count, fits=1) for way in begins]
            promises = [(geometry.promise(way), way) for way in near]
            tried += [(*max(promises, key=lambda one: one[0]), new)] if promises else []
    # Larger sets have improved more by now, so both kinds are kept apart.
    few, more = ([t for t in tried if (len(t[2]) > 1) is pair] for pair in (False, True))
    for kind, most in ((few, limits.SETS_REFITTED), (more, limits.SETS_REFITTED // 2)):
        for way, new in promising(geometry, kind, most):
            with contextlib.suppress(np.linalg.LinAlgError):
                search.keep(names | new, search.refit(way, model))


def promising(
    geometry: StoresGeometry, tried: Sequence[tuple[float, Configuration, Names]], most: int
) -> list[tuple[Configuration, Names]]:
    """The best of some starting points, each with its names, after the better half of them went on:
    a law with a bend shows late how well it fits.

    Source: successive halving (Karnin, Koren and Somekh 2013).
    """
    gain, ends = itemgetter(0), list[tuple[float, Configuration, Names]]()
    half = sorted(tried, key=gain, reverse=True)[: max(most, len(tried) // 2)]
    for promised, way, new in half:
        there = from_afar(geometry.bench, way)
        ends.append(max((promised, way, new), (geometry.promise(there), there, new), key=gain))
    return [(way, new) for _, way, new in sorted(ends, key=gain, reverse=True)[:most]]
