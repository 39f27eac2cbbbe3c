"""Terms without a name: a place that follows a driver by any smooth function."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Candidate, DisturbanceLocation
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.screen import spot_column, variables_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import Evidence, Term, basis_over
from rulec.mismatch.search.latent_input import varying_parameters
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, driver_of, term_of
from rulec.mismatch.search.settled.switching_term import by_the_way


def holds(terms: Iterable[Term], slopes: Array) -> bool:
    """Is a law, by its slopes, shape (open rows,), a special case of some term?

    Differences within the error of form of the law do not count.
    """
    size = float(slopes @ slopes)
    for term in terms:
        left = slopes - term.columns @ np.linalg.lstsq(term.columns, slopes, rcond=None)[0]
        if float(left @ left) < limits.EFFECT_FORM**2 * size:
            return True
    return False


def beside(model: Model, every: Sequence[Term]) -> list[Term]:
    """The terms that neither contain nor are contained in a law or a term of a model."""
    laws = [slopes for candidate in model.setting.joined for slopes in slopes_of(model, candidate)]
    return [
        term
        for term in every
        if not any(holds([term], slopes) for slopes in laws)
        and not any(_whole(term, own) or _whole(own, term) for own in model.terms)
    ]


def coincide(
    geometry: Evidence, model: Model, candidate: Candidate, other: Model, rival: Candidate
) -> bool:
    """Does an explanation of a model show the same as one of another model, with all else refitted?

    Differences within the errors of form of their laws do not count.
    """
    own = [i for u in candidate.unknowns for i in places_of(model, u.id)]
    rest = np.delete(np.arange(model.table.shape[1]), own)
    table, weights = model.table[:, rest], model.weights[:, None]
    normal = table.T @ (table * weights) + model.precision[np.ix_(rest, rest)]
    both = [*slopes_of(model, candidate), *slopes_of(other, rival)]
    shown = geometry.whitened(np.stack(both, axis=1), model.noise)
    with np.errstate(all="ignore"):
        shown = shown - table @ np.linalg.solve(normal, table.T @ (shown * weights))
    shown = shown * np.sqrt(weights)
    count = len(slopes_of(model, candidate))
    first, second = shown[:, :count], shown[:, count:]
    left = second - first @ np.linalg.lstsq(first, second, rcond=None)[0]
    size = np.sum(second**2, axis=0)
    return bool(np.all(np.sum(left**2, axis=0) < limits.EFFECT_FORM**2 * size))


def places_of(model: Model, unknown: str) -> list[int]:
    """Columns of an unknown, with all its levels, in the table of a model."""
    names = enumerate(model.prior.names)
    return [i for i, name in names if name.partition("#")[0] == unknown]


def _whole(term: Term, other: Term) -> bool:
    """Does one term contain another, as at two places that show alike?"""
    return all(holds([term], column) for column in other.columns.T)


def slopes_of(model: Model, candidate: Candidate) -> list[Array]:
    """Slopes of the residuals by the amplitudes of a law, at its fitted values."""
    strengths = [u.id for u in candidate.unknowns if u.null is not None]
    columns = (model.raw[:, i] for name in strengths for i in places_of(model, name))
    return [column for column in columns if np.any(column)]


def terms(geometry: Geometry, model: Model) -> list[Term]:
    """Terms for each place and each driver that the model does not predict."""
    system = geometry.rows.system
    found: list[Term] = []
    for spot in system.builder.spots:
        column = spot_column(model.fitted, spot)
        if column is None:
            continue
        ways, drivers = [(spot, column)], varying(model.fitted, spot.module)
        set_ = [name for name in drivers if system.ruleset.signal_by_id[name].is_input]
        if system.data.timed:
            # A driver seldom adds to a law: it changes a parameter of it.
            ways += [(w.spot, w.column) for w in varying_parameters(model.fitted, spot)]
            for changed, slopes in ways:
                found += _over(geometry, spot.id, changed, slopes, TIME)
                for name in set_:
                    found += by_the_way(geometry, spot.id, changed, slopes[geometry.seen], name)
        for name in drivers:
            found += _over(geometry, spot.id, spot, column, name)
    return found


def _over(
    geometry: Geometry, place: str, changed: DisturbanceLocation, slopes: Array, name: str
) -> Iterator[Term]:
    """Terms over a driver: in a band of it a resonance, in a band of time an unrecorded driver."""
    own, values = slopes[geometry.seen], driver_of(geometry.rows.system, name)
    for length in limits.TERM_LENGTHS:
        term = term_of(geometry, place, changed, own, name, basis_over(values, length))
        if term is not None:
            yield term


def nameless(
    geometry: Evidence, model: Model, every: Sequence[Term], most: int
) -> list[tuple[float, Term]]:
    """The terms that gain most beside a model, with their gain in log odds to first order."""
    found = []
    for term in every:
        gram, moment = model.beside(geometry.whitened(term.columns, model.noise))
        own, ways = np.linalg.eigh(gram)
        square, own = (ways.T @ moment) ** 2, np.maximum(own, 0.0)
        gains = [
            0.5 * float(np.sum(square / (own + s**-2.0)) - np.sum(np.log1p(own * s**2)))
            for s in limits.TERM_SIZES
        ]
        count = len(every) * len(limits.TERM_SIZES)
        odds = max(gains) + limits.TERM_ODDS - term.basis.price - float(np.log(count))
        found.append((odds, term))
    return sorted(found, key=lambda f: -f[0])[:most]


def varying(fitted: Fitted, module: str) -> list[str]:
    """Possible drivers: readings given from outside that vary by more than their noise.

    A reading that the model predicts follows any error, and so explains nothing.
    """
    system, data = fitted.rows.system, fitted.rows.system.data
    read = {name for o in system.observers for name in o.signals}
    names = []
    for name, values in variables_of(system, module).items():
        signal, noise = system.ruleset.signal_by_id[name], data.noise.get(name)
        given = signal.is_input or (name not in read and not _is_flow(system, name))
        if noise is None or not given:
            continue
        spread = float(np.nanstd(values[data.open]))
        if spread > common.FEATURE_VARIES * float(np.nanmedian(noise)):
            names.append(name)
    return names


def _is_flow(system: System, name: str) -> bool:
    """Is a reading a flow that the estimates of its module predict?"""
    flows = system.flows(Configuration())
    values = system.data.values[name]
    own = [i for i, o in enumerate(system.observers) if o.module == name.partition(".")[0]]
    used = system.data.open & np.isfinite(values)
    for i in own:
        there = used & np.isfinite(flows.values[i]) & system.valid[i]
        ratio = values[there] / flows.values[i][there]
        if len(ratio) and abs(float(np.median(ratio)) - 1.0) < limits.SAME_FLOW:
            return True
    return False
