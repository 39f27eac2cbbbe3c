"""How probable sets of explanations are over recordings with other weights of their parts.

No law of the catalogue is exact, and over a long recording a small error that all sets share in
different ways is worth tens of nats: one set would get all of the probability, and another one as
soon as a part of the recording is left out. So parts of the recording are weighted at random, each
set is refitted to first order, and probabilities are means over the draws. What a few operating
states or one stretch of time decide alone is then not sure.

Source: Huggins and Miller 2019, 2023 (bagged posteriors); Rubin 1981 (the Bayesian bootstrap).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.linalg import cho_factor, cho_solve

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.states import states_of
from rulec.mismatch.search import limits
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.settled.refit import Model

Names = frozenset[str]
"""Ids of candidates, those that begin or come and go marked, and names of terms."""


def shares(
    geometry: Geometry, models: Mapping[Names, Model], odds: Mapping[Names, float]
) -> dict[Names, float]:
    """Probability of each set, by its log odds, nats, on the recording as it is.

    Sets too far behind to lead in any draw are as far behind the likeliest one in all.
    """
    most = max(odds.values())
    moving = [n for n in odds if odds[n] > most - limits.RESAMPLED_NATS]
    moving = sorted(moving, key=lambda n: -odds[n])[: limits.RESAMPLED_SETS]
    draws = _draws(geometry)
    every = np.repeat(np.array(list(odds.values()))[:, None], len(draws), axis=1)
    row = {names: i for i, names in enumerate(odds)}
    changes = {names: _changes(geometry, models[names], draws) for names in moving}
    for names in odds:
        every[row[names]] += changes.get(names, changes[moving[0]])
    weight = np.exp(every - every.max(axis=0))
    share = (weight / weight.sum(axis=0)).mean(axis=1)
    return dict(zip(odds, share.tolist(), strict=True))


def _draws(geometry: Geometry) -> Array:
    """Weights of all groups of rows in each draw, shape (draws, groups), 1 on average."""
    point = np.zeros(len(geometry.rank), dtype=np.intp)
    point[geometry.group] = geometry.point
    parts = [part[point] for part in _parts(geometry) if len(np.unique(part[point])) > 1]
    random = np.random.default_rng(0)
    draws = []
    for number in range(limits.RESAMPLES if parts else 1):
        weight = np.ones(len(point))
        if parts:
            part = parts[number % len(parts)]
            weight = random.exponential(size=part.max() + 1)[part]
        draws.append(weight / weight.mean())
    return np.stack(draws)


def _parts(geometry: Geometry) -> Sequence[NDArray[np.intp]]:
    """Number of the part of each point, in two ways: operating states within one length of the
    errors of form, and stretches of time."""
    system = geometry.rows.system
    states = states_of(system, common.FORM_LENGTH)
    if not system.data.timed:
        return [states]
    order = np.argsort(np.argsort(system.data.time, kind="stable"), kind="stable")
    return [states, order * limits.RESAMPLED_STRETCHES // len(order)]


def _changes(geometry: Geometry, model: Model, draws: Array) -> Array:
    """By how much the log evidence of a model changes in each draw, nats, shape (draws,).

    Less their mean: what counts more than once shows its noise as if it were a law, and the more
    freely a model errs, the more it gains by that.
    """
    table, precision = _without_what_is_not_seen(model)
    found: Array = np.array([_score(geometry, model, table, precision, d) for d in draws])
    return found - float(found.mean())


def _without_what_is_not_seen(model: Model) -> tuple[Array, Array]:
    """Slopes and prior precision of a model, its random columns as few that show the same."""
    n = len(model.at)
    random = model.table[:, n:] * np.sqrt(model.weights)[:, None]
    ways = np.linalg.svd(random, full_matrices=False)
    kept = ways[1] > limits.FORM_NOT_SEEN
    table = np.concatenate([model.table[:, :n], model.table[:, n:] @ ways[2][kept].T], axis=1)
    precision = np.eye(table.shape[1])
    precision[:n, :n] = model.precision[:n, :n]
    return table, precision


def _score(geometry: Geometry, model: Model, table: Array, precision: Array, draw: Array) -> float:
    """Log evidence of a model, less what is the same in all draws; noise and sizes are held."""
    each, weights, score = draw[geometry.group], model.weights, -np.inf
    for _ in range(2):
        normal = table.T @ (table * (each * weights)[:, None]) + precision
        size = np.sqrt(np.diag(normal))
        normal /= size[:, None] * size
        normal[np.diag_indices(len(size))] += 1e-13
        factor = cho_factor(normal, lower=True, overwrite_a=True, check_finite=False)
        moment = table.T @ (each * weights * model.left)
        solution = -cho_solve(factor, moment / size, check_finite=False) / size
        residual = model.left + table @ solution
        found = -float(draw @ geometry.lost(residual, model.scale))
        found -= 0.5 * float(solution @ precision @ solution)
        found -= float(np.sum(np.log(np.diag(factor[0]))) + np.sum(np.log(size)))
        score = max(score, found)
        weights = geometry.weights(residual, model.scale)
    return score
