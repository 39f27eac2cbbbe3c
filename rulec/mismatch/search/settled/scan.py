"""The gain of every candidate and every pair of candidates beside a model, to first order."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import Configuration, Course, lasting
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    columns_of,
    has_drivers,
    references,
    starts,
)
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import Evidence
from rulec.mismatch.search.intermittent_fault import in_periods, intermittent
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry

COMES, GROWS = "!", "/"
"""Marks after the id of a candidate that begins or comes and goes, and of one that grows."""


def name_of(setting: Configuration, candidate: Candidate) -> str:
    """The id of a joined candidate, marked as in `Column.name`."""
    own = {u.id for u in candidate.unknowns}
    course = next((c for c in setting.courses if c.unknown in own), None)
    if course is None:
        return candidate.id
    return candidate.id + (GROWS if course.grows else COMES)


def id_of(name: str) -> str:
    """The id of a candidate by its name, without marks."""
    return name.rstrip(COMES + GROWS)


@dataclass(frozen=True, kw_only=True)
class Column:
    """One amplitude of a candidate with its other unknowns held; `rows` are its slopes.

    A fault begins at `since`, s, or `grows` from then on. `course` has the periods of one that
    comes and goes.
    """

    candidate: Candidate
    amplitude: Unknown
    values: dict[str, float]
    fixed: dict[str, float]
    rows: Array
    since: float | None = None
    course: Course | None = None
    grows: bool = False

    @property
    def name(self) -> str:
        """The id of the candidate, marked where it begins, comes and goes, or grows."""
        if self.grows:
            return self.candidate.id + GROWS
        lasts = self.since is None and self.course is None
        return self.candidate.id + ("" if lasts else COMES)


Start = tuple[Column, float]
"""A column, and the amplitude from which to start a refit."""


@dataclass(frozen=True)
class Found:
    """Columns that may be joined together, and their gain in log odds."""

    gain: float
    starts: tuple[Start, ...]

    @property
    def names(self) -> frozenset[str]:
        """Names of the columns."""
        return frozenset(column.name for column, _ in self.starts)

    @property
    def shapes(self) -> frozenset[tuple[str, frozenset[tuple[str, float]]]]:
        """Names of the columns, each with the values at which it was made."""
        return frozenset((c.name, frozenset(c.values.items())) for c, _ in self.starts)


def columns(geometry: Geometry, model: Model, alike: Alike) -> list[Column]:
    """A column for each amplitude of each candidate, at several shapes and onsets."""
    system, seen = geometry.rows.system, geometry.seen
    joined = shut_out(model, alike)
    found: list[Column] = []
    for candidate in system.candidates:
        if candidate.id in joined or not has_drivers(system, candidate):
            continue
        amplitudes = [u for u in candidate.unknowns if u.null is not None and not u.fixed]
        null = {u.id: u.null for u in amplitudes if u.null is not None}
        fixed = references(system, candidate)
        for shape in starts(system, candidate) if amplitudes else ():
            own = {**null, **shape}
            table = columns_of(model.fitted, candidate, own, fixed)
            if table is None or not np.isfinite(table).all():
                continue
            found += [
                Column(candidate=candidate, amplitude=u, values=own, fixed=fixed, rows=rows)
                for u, rows in zip(amplitudes, table[seen].T, strict=True)
                if rows.any()
            ]
    return [*found, *_begun(geometry, found)] if system.data.timed else found


def _begun(geometry: Geometry, every: Sequence[Column]) -> list[Column]:
    """Faults that begin during the recording, as a step or growing in proportion to time."""
    time = geometry.rows.system.data.time
    onsets = np.quantile(time, np.linspace(0.06, 0.94, limits.ONSETS)).tolist()
    growing = np.quantile(time, np.linspace(0.0, 0.9, limits.GROWING_ONSETS)).tolist()
    ways = [*((since, False) for since in onsets), *((since, True) for since in growing)]
    shares = {
        (since, grows): lasting("", since, time, grows=grows).share(0)[geometry.point]
        for since, grows in ways
    }
    begun = [
        replace(c, since=since, grows=grows, rows=c.rows * share)
        for c in every
        if c.candidate.sort == "fault"
        for (since, grows), share in shares.items()
    ]
    return [c for c in begun if c.rows.any()]


Alike = Mapping[str, frozenset[str]]
"""Per fault those with the same or the opposite signature: only one of them may be joined."""


def alike_faults(found: Sequence[Column]) -> Alike:
    """Faults whose columns are parallel or antiparallel."""
    faults = {c.candidate.id: c.rows for c in found if c.candidate.sort == "fault" if not c.since}
    alike: dict[str, frozenset[str]] = {}
    for name, rows in faults.items():
        cosines = {
            other: abs(float(rows @ own)) / float(np.linalg.norm(rows) * np.linalg.norm(own))
            for other, own in faults.items()
        }
        alike[name] = frozenset(o for o, cosine in cosines.items() if cosine > common.SAME_PATTERN)
    return alike


def shut_out(model: Model, alike: Alike) -> frozenset[str]:
    """Ids of joined candidates and of faults with the signature of one: these cannot be joined."""
    joined = {c.id for c in model.setting.joined}
    return frozenset(joined).union(*(alike.get(name, frozenset()) for name in joined))


def intermittent_faults(every: Rows, model: Model, alike: Alike, times: Array) -> list[Found]:
    """Faults that come and go, found on all points and transferred to means at `times`, s."""
    known = shut_out(model, alike)
    free = [c for c in every.system.candidates if c.id not in known]
    trials = intermittent(_on_all_points(every, model.setting), free)
    found = (_at_means(trial, times) for trial in trials)
    return [one for one in found if one is not None]


def periods_again(
    every: Rows, setting: Configuration, fault: Candidate, times: Array
) -> Found | None:
    """Find the periods of a fault again, beside all else in a setting."""
    trial = in_periods(_on_all_points(every, setting.leaving(fault.id)), fault)
    return None if trial is None else _at_means(trial, times)


def _on_all_points(every: Rows, setting: Configuration) -> Fitted:
    data = every.system.data
    return fit(every, at_points(setting, data.time), data.open, 0)


def at_points(setting: Configuration, time: Array) -> Configuration:
    """A setting with its courses at other points, shape (n,), s.

    The value of a growing course is the degree at the last point.
    """
    values, courses = dict(setting.values), []
    for course in setting.courses:
        if course.grows:
            ((own,), (name,)) = course.periods, course.names()
            course = course.since(own.since, time)
            values[name] *= (course.periods[0].until - own.since) / (own.until - own.since)
        else:
            course = course.at_times(time)
        courses.append(course)
    return replace(setting, values=values, courses=tuple(courses))


def _at_means(trial: InitialCandidate, times: Array) -> Found | None:
    """A fault that comes and goes, at means; None where they miss one of its degrees."""
    assert trial.course is not None
    amplitude = next(u for u in trial.candidate.unknowns if u.null is not None)
    course = trial.course.at_times(times)
    if not set(range(course.levels)) <= set(course.segment.tolist()):
        return None
    column = Column(
        candidate=trial.candidate,
        amplitude=amplitude,
        values=dict(trial.values),
        fixed={},
        rows=np.zeros(0),
        course=course,
    )
    return Found(trial.gain, ((column, 0.0),))


def scan(
    geometry: Evidence,
    model: Model,
    every: Sequence[Column],
    alike: Alike,
    most: int,
    of: Set[str] | None = None,
) -> list[Found]:
    """The best single columns and pairs beside a model, by three views of the recording.

    One has the weights of the model. One weights all rows alike, which shows large and rare errors.
    One ignores all calibrations, as each may have been made with the effect present. Candidates are
    limited to the ids `of`.
    """
    every = [c for c in every if of is None or c.candidate.id in of]
    alone = not model.setting.joined and not model.terms
    noises = geometry.levels(model.noise, model.rest, alone=alone)
    levels = [model.under(geometry, noise) for noise in noises]
    views = [(model, most), *((level, most // 2) for level in levels)]
    views.append((_by_sheet(model), most // 2))
    found = [f for view, count in views for f in _scanned(geometry, view, every, count)]
    if alone:
        # Far from the model slopes hardly predict the gain of a large effect: more are tried.
        count = limits.FIRST_SETS if len(levels) == 1 else most
        found += _scanned(geometry, levels[0], every, count, 0)
        found += _scanned(geometry, _with_exact_laws(geometry, model), every, count, 0)
    found = [f for f in found if not _has_alike_faults(f, alike)]
    return sorted(found, key=lambda f: -f.gain)


def _has_alike_faults(found: Found, alike: Alike) -> bool:
    ids = [column.candidate.id for column, _ in found.starts]
    return any(b in alike.get(a, ()) for a, b in combinations(ids, 2))


def _with_exact_laws(geometry: Evidence, model: Model) -> Model:
    """A model with smaller errors of laws and of sensors that move, and calibrations as firm as
    stated: where a large effect is missing these replace it, so that no explanation would gain
    anything beside them."""
    table, n = model.table.copy(), len(model.at)
    table[:, n : n + geometry.forms.shape[1] + geometry.moving.shape[1]] *= limits.STIFF
    precision = model.precision.copy()
    precision[:n, :n] = model.prior.near(model.mean).precision
    return replace(model, table=table, precision=precision)


def _by_sheet(model: Model) -> Model:
    """A model with the prior of the data sheets, without calibrations."""
    known, n = model.prior.belief.by_sheet, len(model.at)
    k = len(known.mean)
    precision, mean = model.precision.copy(), model.mean.copy()
    precision[:k, :k], mean[:k] = known.precision, known.mean
    left = model.left + model.table[:, :n] @ (mean - model.mean)
    return replace(model, precision=precision, left=left)


def _scanned(
    geometry: Evidence,
    model: Model,
    every: Sequence[Column],
    most: int,
    paired: int = limits.PAIRED_COLUMNS,
) -> list[Found]:
    if not every:
        return []
    usual = [geometry.size(c.candidate, c.amplitude) for c in every]
    scale = np.array([u.scale for u in usual])
    rows = geometry.whitened(np.stack([c.rows for c in every], axis=1), model.noise) * scale
    gram, moment = model.beside(rows)
    # A Student distribution is a normal one of unknown width: where the recording needs more than
    # the usual size, a wider one costs as much as the tail.
    wide = limits.WIDER * np.abs(moment) / np.maximum(np.diag(gram), 1e-12)
    wide = np.maximum(wide, 1.0)
    odds = _odds(every) - np.array([u.freedom for u in usual]) * np.log(wide)
    gram, moment, size = gram * np.outer(wide, wide), moment * wide, scale * wide
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
        try:
            amplitudes = np.clip(-np.linalg.solve(inner, moment[chosen]), low[chosen], high[chosen])
        except np.linalg.LinAlgError:  # Columns that coincide are no pair.
            continue
        begins = tuple(
            (every[i], float(null[i] + a * size[i]))
            for i, a in zip(members, amplitudes, strict=True)
        )
        found = Found(score, begins)
        if np.isfinite(score) and score > limits.WORTH_A_REFIT:
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
    """The best pairs of columns and their gain in log odds: of two candidates, or two amplitudes of
    one, whose prior counts once."""
    low, high = bounds
    kept = np.argsort(-single)[:paired]
    first, second = (kept[i] for i in np.triu_indices(len(kept), 1))
    ids = np.array([c.candidate.id for c in every])
    apart, whole = ids[first] != ids[second], np.zeros(len(first), dtype=bool)
    for k in np.flatnonzero(~apart):
        whole[k] = _is_one(every[first[k]], every[second[k]])
    legal = apart | whole
    first, second, whole = first[legal], second[legal], whole[legal]
    both = gram[first, second]
    determinant = np.maximum(own[first] * own[second] - both**2, 1e-12)
    one = -(own[second] * moment[first] - both * moment[second]) / determinant
    other = -(own[first] * moment[second] - both * moment[first]) / determinant
    gain = -0.5 * (moment[first] * one + moment[second] * other) - 0.5 * np.log(determinant)
    gain += odds[first] + odds[second] - np.where(whole, _odds(every)[second], 0.0)
    legal = (one >= low[first]) & (one <= high[first])
    legal &= (other >= low[second]) & (other <= high[second])
    gain = np.where(legal, gain, -np.inf)
    best = np.argsort(-gain)[:most]
    return [(float(gain[i]), (int(first[i]), int(second[i]))) for i in best]


def _is_one(a: Column, b: Column) -> bool:
    """Are two columns different amplitudes of one permanent candidate of the same shape?"""
    throughout = a.since is None and b.since is None and a.course is None and b.course is None
    alike = a.candidate.id == b.candidate.id and a.amplitude.id != b.amplitude.id
    return throughout and alike and a.values == b.values


def _odds(every: Sequence[Column]) -> Array:
    """Prior log odds of each column, by its sort and the number of alternatives."""
    ways = Counter(c.candidate.id for c in every)
    each = [limits.SORT_ODDS[c.candidate.sort] - 0.5 * np.log(ways[c.candidate.id]) for c in every]
    return np.asarray(np.array(each) - np.log(len(ways)))


def joined(
    setting: Configuration, begins: Sequence[Start], time: Array | None = None
) -> Configuration:
    """Join columns to a setting; `time` is that of settled points, s, shape (n,)."""
    for column, value in begins:
        candidate, name = column.candidate, column.amplitude.id
        if candidate.id in {c.id for c in setting.joined}:
            setting = replace(setting, values={**setting.values, name: value})
        elif column.course is not None:
            setting = setting.joining(candidate, column.values, column.fixed, column.course)
        elif column.since is None or time is None:
            setting = setting.joining(candidate, {**column.values, name: value}, column.fixed)
        else:
            course = lasting(name, column.since, time, grows=column.grows)
            setting = setting.joining(candidate, {f"{name}#0": value}, column.fixed, course)
    return setting
