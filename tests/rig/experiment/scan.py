"""What every candidate, and every two of them, would gain at a model, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Candidate, Unknown
from rulec.mismatch.evidence.steady.configuration import Configuration, Course, Span
from rulec.mismatch.evidence.steady.fit import prior_of
from rulec.mismatch.evidence.steady.locate import spot_column
from rulec.mismatch.evidence.steady.screen import _has_drivers, columns_of, references, starts
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.search.free_form import _varying
from tests.rig.experiment.model import SIZES, Geometry, Model, Term

ODDS = {"physics": 0.0, "ageing": -0.5, "fault": -1.0, "sensor": -2.0, "free": -20.0}
"""How much less expected each sort is, in log odds [assumed]."""

ONSETS = 23
"""Times at which a fault may begin that are tried."""

PAIRED = 500
"""Columns of which all pairs are scanned: those that gain most alone."""

ALONE = 40
"""Sets that are tried at first [assumed]."""

WORTH = -2.0
"""Log odds to first order from which on a set is refitted."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """One amplitude of a candidate, with all else that it brings held; `rows` are its slopes.

    `since` is when a fault begins, s.
    """

    candidate: Candidate
    amplitude: Unknown
    values: dict[str, float]
    fixed: dict[str, float]
    rows: Array
    since: float | None = None

    @property
    def name(self) -> str:
        """The id of the candidate, marked where it begins while the recording runs."""
        return self.candidate.id + ("" if self.since is None else "!")


Start = tuple[Column, float]
"""A column, and the amplitude to start a refit from."""


@dataclass(frozen=True)
class Found:
    """Columns that together may explain something, with the log odds they would gain."""

    gain: float
    starts: tuple[Start, ...]

    @property
    def names(self) -> frozenset[str]:
        """What is joined."""
        return frozenset(column.name for column, _ in self.starts)


def columns(geometry: Geometry, model: Model) -> list[Column]:
    """A column for each amplitude of each candidate, at several shapes and onsets."""
    system, seen = geometry.rows.system, geometry.seen
    joined = {c.id for c in model.setting.joined}
    found: list[Column] = []
    for candidate in system.candidates:
        if candidate.id in joined or not _has_drivers(system, candidate):
            continue
        amplitudes = [u for u in candidate.unknowns if u.null is not None and not u.fixed]
        null = {u.id: u.null for u in amplitudes if u.null is not None}
        fixed = references(system, candidate)
        for shape in starts(system, candidate) if amplitudes else ():
            table = columns_of(model.fitted, candidate, {**null, **shape}, fixed)
            if table is None or not np.isfinite(table).all():
                continue
            for unknown, rows in zip(amplitudes, table[seen].T, strict=True):
                if rows.any():
                    column = Column(
                        candidate=candidate,
                        amplitude=unknown,
                        values={**null, **shape},
                        fixed=fixed,
                        rows=rows,
                    )
                    found.append(column)
    return [*found, *_begun(geometry, found)] if system.data.timed else found


def _begun(geometry: Geometry, every: Sequence[Column]) -> list[Column]:
    """Faults that begin while the recording runs."""
    time = geometry.rows.system.data.time
    onsets = np.quantile(time, np.linspace(0.06, 0.94, ONSETS)).tolist()
    begun = [
        replace(c, since=since, rows=c.rows * (time[geometry.point] >= since))
        for c in every
        if c.candidate.sort == "fault"
        for since in onsets
    ]
    return [c for c in begun if c.rows.any()]


def scan(geometry: Geometry, model: Model, every: Sequence[Column], most: int) -> list[Found]:
    """The best sets of one column or two beside a model, under three views of the recording.

    As it is weighed in the model; with all rows alike, in which what is large and rare shows; and
    with all calibrations let go, which may have been made with the effect in it.
    """
    alike = replace(model, weights=np.full(len(model.left), model.scale**-2))
    views = [(model, most), (alike, most // 2), (_let_go(geometry, model), most // 2)]
    # Far from the model a slope says little of what a large effect would gain: at first each one
    # that may gain is tried.
    found = [f for view, count in views for f in _scanned(geometry, view, every, count)]
    if not model.setting.joined and not model.terms:
        alone = _scanned(geometry, alike, every, ALONE, 0)
        found += alone
    return sorted(found, key=lambda f: -f.gain)


def _let_go(geometry: Geometry, model: Model) -> Model:
    system = geometry.rows.system
    free = prior_of(system, model.setting.letting_go(system.modules))
    n = len(model.at)
    plain = np.array([not _is_of_effect(name) for name in free.names], dtype=bool)
    precision, mean = model.precision.copy(), np.where(plain, free.mean, model.prior.mean)
    at = np.flatnonzero(plain)
    ridge = np.diag(1e-12 / free.size[at] ** 2)
    precision[np.ix_(at, at)] = free.precision[np.ix_(at, at)] + ridge
    left = model.left + model.table[:, :n] @ (mean - model.prior.mean)
    return replace(model, precision=precision, left=left)


def _is_of_effect(name: str) -> bool:
    return "@" in name or "#" in name


def _scanned(
    geometry: Geometry, model: Model, every: Sequence[Column], most: int, paired: int = PAIRED
) -> list[Found]:
    weights, table = model.weights, model.table
    size = np.array([geometry.size(c.candidate, c.amplitude).scale for c in every])
    if not every:
        return []
    rows = np.stack([c.rows for c in every], axis=1) * size
    normal = table.T @ (table * weights[:, None]) + model.precision
    unit = np.sqrt(np.diag(normal))
    factor = np.linalg.cholesky(normal / np.outer(unit, unit) + 1e-12 * np.eye(len(unit)))
    imitated = np.linalg.solve(factor, (table / unit).T @ (rows * weights[:, None]))
    known = np.linalg.solve(factor, (table / unit).T @ (model.left * weights))
    gram = rows.T @ (rows * weights[:, None]) - imitated.T @ imitated
    moment = rows.T @ (model.left * weights) - imitated.T @ known
    odds = _odds(every)
    null = np.array([c.amplitude.null or 0.0 for c in every])
    low = (np.array([c.amplitude.lowest for c in every]) - null) / size
    high = (np.array([c.amplitude.highest for c in every]) - null) / size
    own = 1.0 + np.maximum(np.diag(gram), 0.0)
    alone = np.clip(-moment / own, low, high)
    single = -(0.5 * own * alone**2 + moment * alone) - 0.5 * np.log(own) + odds
    sets: list[tuple[float, tuple[int, ...]]] = [
        (float(single[i]), (int(i),)) for i in np.argsort(-single)[: 4 * most]
    ]
    if paired:
        sets += _pairs_of(every, single, gram, moment, own, odds, (low, high), 4 * most, paired)
    result: dict[frozenset[str], Found] = {}
    for score, members in sorted(sets, key=lambda s: -s[0]):
        chosen = np.array(members)
        inner = np.eye(len(chosen)) + gram[np.ix_(chosen, chosen)]
        amplitudes = np.clip(-np.linalg.solve(inner, moment[chosen]), low[chosen], high[chosen])
        begins = tuple(
            (every[i], float(null[i] + a * size[i]))
            for i, a in zip(members, amplitudes, strict=True)
        )
        found = Found(score, begins)
        if np.isfinite(score) and score > WORTH:
            result.setdefault(found.names, found)
    return list(result.values())[:most]


def _pairs_of(
    every: Sequence[Column],
    single: Array,
    gram: Array,
    moment: Array,
    own: Array,
    odds: Array,
    bounds: tuple[Array, Array],
    most: int,
    paired: int,
) -> list[tuple[float, tuple[int, ...]]]:
    """The best pairs of columns of different candidates, with the log odds they would gain."""
    low, high = bounds
    kept = np.argsort(-single)[:paired]
    first, second = (kept[i] for i in np.triu_indices(len(kept), 1))
    apart = np.array(
        [every[i].candidate.id != every[j].candidate.id for i, j in zip(first, second, strict=True)]
    )
    first, second = first[apart], second[apart]
    both = gram[first, second]
    determinant = np.maximum(own[first] * own[second] - both**2, 1e-12)
    one = -(own[second] * moment[first] - both * moment[second]) / determinant
    other = -(own[first] * moment[second] - both * moment[first]) / determinant
    gain = -0.5 * (moment[first] * one + moment[second] * other) - 0.5 * np.log(determinant)
    gain += odds[first] + odds[second]
    legal = (one >= low[first]) & (one <= high[first])
    legal &= (other >= low[second]) & (other <= high[second])
    gain = np.where(legal, gain, -np.inf)
    best = np.argsort(-gain)[:most]
    return [(float(gain[i]), (int(first[i]), int(second[i]))) for i in best]


def _odds(every: Sequence[Column]) -> Array:
    """Log odds of each column before the recording: of its sort, among so many ways."""
    names = [c.candidate.id for c in every]
    ways = {name: names.count(name) for name in set(names)}
    each = [ODDS[c.candidate.sort] - 0.5 * np.log(ways[c.candidate.id]) for c in every]
    return np.array(each) - np.log(len(ways))


def joined(system: System, setting: Configuration, begins: Sequence[Start]) -> Configuration:
    """A setting with columns joined."""
    time = system.data.time
    for column, value in begins:
        candidate, name = column.candidate, column.amplitude.id
        if candidate.id in {c.id for c in setting.joined}:
            setting = replace(setting, values={**setting.values, name: value})
        elif column.since is None:
            setting = setting.joining(candidate, {**column.values, name: value}, column.fixed)
        else:
            segment: NDArray[np.intp] = np.where(time >= column.since, 0, -1)
            course = Course(name, segment, (Span(column.since, float(time[-1]), 0),))
            setting = setting.joining(candidate, {f"{name}#0": value}, column.fixed, course)
    return setting


FUNCTIONS = 6
"""Smooth functions of a driver that a term without a name may hold."""

NAMELESS = -1.0
"""Log odds of a term without a name against a law [assumed]."""


def terms(geometry: Geometry, model: Model) -> list[Term]:
    """A term for each place and each driver that no model predicts."""
    system, found = geometry.rows.system, []
    for spot in system.builder.spots:
        column = spot_column(model.fitted, spot)
        if column is None:
            continue
        drivers = _varying(model.fitted, spot.module)
        for name in [*drivers, *([TIME] if system.data.timed else [])]:
            values = system.data.time if name == TIME else system.data.values[name]
            table = column[geometry.seen, None] * _smooth(values)[geometry.point]
            size = float(np.sqrt(np.mean(table[:, 0] ** 2)))
            if size > 0.0 and np.isfinite(table).all():
                found.append(Term(f"{spot.id}~{name}", table / size))
    return found


def _smooth(values: Array) -> Array:
    """Independent smooth functions of a driver, of unit prior size, shape (n, functions)."""
    known = np.nan_to_num(values, nan=float(np.nanmedian(values)))
    low, high = np.quantile(known, [0.02, 0.98])
    z = np.clip((known - low) / max(float(high - low), 1e-300), -0.1, 1.1)
    knots = np.linspace(0.0, 1.0, 41)
    kernel = np.exp(-0.5 * ((knots[:, None] - knots[None, :]) / SMOOTH) ** 2) + 1.0
    size, ways = np.linalg.eigh(kernel)
    best = np.argsort(-size)[:FUNCTIONS]
    table = [np.interp(z, knots, ways[:, i] * np.sqrt(size[i])) for i in best]
    return np.stack(table, axis=1)


SMOOTH = 0.4
"""Distance, as share of a driver's range, over which a term without a name is alike [assumed]."""


def nameless(model: Model, every: Sequence[Term], most: int) -> list[tuple[float, Term]]:
    """The terms that gain most beside a model, with the log odds they would gain."""
    weights, table = model.weights, model.table
    normal = table.T @ (table * weights[:, None]) + model.precision
    unit = np.sqrt(np.diag(normal))
    factor = np.linalg.cholesky(normal / np.outer(unit, unit) + 1e-12 * np.eye(len(unit)))
    known = np.linalg.solve(factor, (table / unit).T @ (model.left * weights))
    found = []
    for term in every:
        rows = term.columns
        imitated = np.linalg.solve(factor, (table / unit).T @ (rows * weights[:, None]))
        gram = rows.T @ (rows * weights[:, None]) - imitated.T @ imitated
        moment = rows.T @ (model.left * weights) - imitated.T @ known
        own, ways = np.linalg.eigh(gram)
        square, own = (ways.T @ moment) ** 2, np.maximum(own, 0.0)
        gains = [
            0.5 * float(np.sum(square / (own + s**-2.0)) - np.sum(np.log1p(own * s**2)))
            for s in SIZES.tolist()
        ]
        found.append((max(gains) + NAMELESS - float(np.log(len(every) * len(SIZES))), term))
    return sorted(found, key=lambda f: -f[0])[:most]
