"""What every candidate, and every two of them, would gain at a model, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch.evidence.steady.configuration import Configuration, Course, Span
from rulec.mismatch.evidence.steady.fit import prior_of
from rulec.mismatch.evidence.steady.screen import _has_drivers, columns_of, references, starts
from rulec.mismatch.evidence.steady.system import System
from tests.rig.experiment.model import Geometry, Model, usual_size

ODDS = {"physics": 0.0, "ageing": -0.5, "fault": -1.0, "sensor": -2.0, "free": -20.0}
"""How much less expected each sort is, in log odds [assumed]."""

ONSETS = 23
"""Times at which a fault may begin that are tried."""

PAIRED = 500
"""Columns of which all pairs are scanned: those that gain most alone."""

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
    found = [f for view, count in views for f in _scanned(view, every, count)]
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


def _scanned(model: Model, every: Sequence[Column], most: int) -> list[Found]:
    weights, table = model.weights, model.table
    size = np.array([usual_size(c.amplitude) for c in every])
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
    kept = np.argsort(-single)[:PAIRED]
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
    for i in np.argsort(-gain)[: 4 * most]:
        sets.append((float(gain[i]), (int(first[i]), int(second[i]))))
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
