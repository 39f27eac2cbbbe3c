"""A set of explanations refitted, and its evidence by Laplace's approximation.

Errors of the outputs follow a Student distribution per point. Each output may besides be off by an
error of form: a share of its usual size that is smooth over the inputs. How large that share is,
and how large the noise, is found anew for every set of explanations. Calibrations have Student
tails; so have sizes of effects, about nothing; a threshold or an exponent lies anywhere in the
range of what it acts on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.linalg import cho_factor, cho_solve
from scipy.special import gammaln
from scipy.stats import t as student

from rulec.effects.candidate import TIME, Candidate, Unknown
from rulec.mismatch.evidence.steady import fit as steady
from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, Prior
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import references, starts
from rulec.mismatch.evidence.steady.system import System
from tests.rig.experiment.states import likeness

FREEDOM = 4.0
"""Degrees of freedom of the errors and of what calibrations state [usual choice]."""

FORMS = np.array([1e-5, 0.001, 0.002, 0.004, 0.008, 0.015, 0.03, 0.06])
FORM = 0.01
"""Errors of form that are tried, as share of an output's size, and their usual one [assumed]."""

SCALES = np.array([0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.2, 3.0])
"""Sizes of the noise that are tried, in units of what was expected: half as likely at 1.7 times."""

SIZES = np.geomspace(1.0, 3000.0, 8)
"""Sizes of terms without a name that are tried, in units of the noise of one point."""

EFFECT_FORM = 0.03
"""Error of form of an effect's own law, as share of it [assumed]."""

OFF = 0.3
"""An error of form below this many standard deviations of the noise is not carried along."""


@dataclass(frozen=True)
class Term:
    """A change at a place that follows a driver in a way without a name.

    `columns`, shape (seen rows, functions), are smooth functions of the driver, each as it shows;
    how large they are is found with the errors of form.
    """

    name: str
    columns: Array


@dataclass(frozen=True)
class Random:
    """Columns whose sizes are found: errors of form, and terms without a name."""

    forms: Array
    terms: tuple[Term, ...]

    @property
    def count(self) -> int:
        """Number of columns."""
        return self.forms.shape[1] + sum(t.columns.shape[1] for t in self.terms)

    def ratio(self, form: float, sizes: Sequence[float]) -> Array:
        """Standard deviation of each column's number, shape (columns,)."""
        parts = [np.full(self.forms.shape[1], form)]
        parts += [np.full(t.columns.shape[1], s) for t, s in zip(self.terms, sizes, strict=True)]
        return np.concatenate(parts)

    def loads(self, form: float, sizes: Sequence[float]) -> Array:
        """Columns in units of those, shape (rows, columns)."""
        whole = np.concatenate([self.forms, *(t.columns for t in self.terms)], axis=1)
        loaded: Array = whole * self.ratio(form, sizes)
        return loaded


class Geometry:
    """What stays the same for all models of one recording; `rows` are those that may be seen."""

    def __init__(self, rows: Rows) -> None:
        system = rows.system
        self.rows = rows
        self._sizes: dict[str, Size] = {}
        self.seen = system.data.open[rows.point]
        self.point = rows.point[self.seen]
        self.forms = self._forms(likeness(system))
        self.group: NDArray[np.intp] = np.unique(rows.group[self.seen], return_inverse=True)[1]
        self.rank = np.bincount(self.group).astype(float)
        constants = gammaln((FREEDOM + self.rank) / 2) - self.rank / 2 * np.log(FREEDOM)
        self.constant = float(np.sum(constants - gammaln(FREEDOM / 2)))

    def size(self, candidate: Candidate, unknown: Unknown) -> Size:
        """The prior of an amplitude."""
        if unknown.id not in self._sizes:
            self._sizes[unknown.id] = size_of(self.rows.system, candidate, unknown)
        return self._sizes[unknown.id]

    def _forms(self, alike: Array) -> Array:
        """Rows of errors of form of unit size, shape (rows, errors)."""
        rows, columns = self.rows, []
        values = rows.system.data.values
        for cell in rows.cells:
            size, ways = np.linalg.eigh(alike[np.ix_(cell.points, cell.points)])
            kept = size > 1e-3 * size.max()
            smooth = ways[:, kept] * np.sqrt(size[kept])
            for i, name in enumerate(cell.outputs):
                usual = np.sqrt(np.nanmean(values[name][rows.system.data.open] ** 2))
                table = np.zeros((len(rows), smooth.shape[1]))
                weight = (cell.whitener[:, :, i] * usual).T.ravel()
                table[cell.rows] = weight[:, None] * np.tile(smooth, (cell.rank, 1))
                columns.append(table[self.seen])
        left, size, _ = np.linalg.svd(np.concatenate(columns, axis=1), full_matrices=False)
        kept = size * FORMS[-1] > OFF
        forms: Array = left[:, kept] * size[kept]
        return forms

    def _distance(self, residual: Array, scale: float) -> Array:
        distance: Array = np.bincount(self.group, residual**2) / scale**2
        return distance

    def likelihood(self, residual: Array, scale: float) -> float:
        """Log likelihood of the seen rows."""
        far = np.log1p(self._distance(residual, scale) / FREEDOM)
        tails = self.rank * np.log(scale) + 0.5 * (FREEDOM + self.rank) * far
        return self.constant - float(tails.sum())

    def weights(self, residual: Array, scale: float) -> Array:
        """Weights of the rows in the normal matrix."""
        each = (FREEDOM + self.rank) / (FREEDOM + self._distance(residual, scale))
        weights: Array = each[self.group] / scale**2
        return weights


@dataclass(frozen=True, kw_only=True)
class Model:
    """A refitted set of explanations.

    `table` shape (rows, values) are slopes by the values, errors of form and errors of the
    effects' forms; `left`, shape (rows,), the residual at the means of the values; `precision` that
    of the prior, `weights` those of the rows. `evidence` is the log marginal likelihood.
    """

    fitted: Fitted
    prior: Prior
    at: Array
    forms: Array
    terms: tuple[Term, ...]
    form: float
    scale: float
    evidence: float
    table: Array
    left: Array
    precision: Array
    weights: Array

    @property
    def setting(self) -> Configuration:
        """What is joined, and all values."""
        return self.fitted.setting


@dataclass(frozen=True)
class Size:
    """Prior of an amplitude: Student about its null with this scale and degrees of freedom.

    Half of all amplitudes are below the usual one, and the tail falls as that of the log-normal
    distribution does at two of its standard deviations.
    """

    scale: float
    freedom: float

    @property
    def peak(self) -> float:
        """Log density at the null, less that of the normal distribution of the same scale."""
        n = self.freedom
        gain = float(gammaln((n + 1) / 2) - gammaln(n / 2))
        return gain - 0.5 * float(np.log(n * np.pi)) + 0.5 * float(np.log(2 * np.pi))


def size_of(system: System, candidate: Candidate, unknown: Unknown) -> Size:
    """The prior of an amplitude by what its entry says is usual."""
    usual = unknown.usual
    if usual is None:
        width = unknown.highest - unknown.lowest
        return Size(width / 4.0 if np.isfinite(width) else 1.0, 1.0)
    freedom = 2.0 / float(np.log(usual.factor))
    median = usual.size / _share(system, candidate, unknown) if usual.of_place else usual.size
    return Size(median / float(student.ppf(0.75, freedom)), freedom)


def _share(system: System, candidate: Candidate, unknown: Unknown) -> float:
    """The share by which estimates change per amplitude, the most at any shape."""
    null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
    fixed, shares = references(system, candidate), []
    plain = system.flows(Configuration()).values
    for shape in starts(system, candidate):
        setting = Configuration().joining(candidate, {**null, **shape}, fixed)
        modules = system.reached(candidate.observers)
        slopes = system.flows(setting, [unknown.id], modules=modules).by_value[unknown.id]
        for i, slope in slopes.items():
            with np.errstate(invalid="ignore", divide="ignore"):
                share = np.broadcast_to(slope, plain[i].shape) / plain[i]
            share = share[system.data.open & system.valid[i] & np.isfinite(share)]
            shares.append(float(np.sqrt(np.mean(share**2))) if len(share) else 0.0)
    return max(shares, default=0.0) or 1.0


class _Prior:
    """What is known of the values: those of the plant, amplitudes of effects, their shapes."""

    def __init__(self, geometry: Geometry, setting: Configuration) -> None:
        rows = geometry.rows
        own = {u.id: (c, u) for c in setting.joined for u in c.unknowns}
        plain = steady.prior_of(rows.system, setting)
        mean, precision = plain.mean.copy(), plain.precision.copy()
        stems = [name.partition("#")[0] for name in plain.names]
        self.effect = np.array([stem in own for stem in stems])
        self.amplitude = np.zeros(len(stems), dtype=bool)
        self.freedom = np.ones(len(stems))
        self.peak = 0.0
        for i in np.flatnonzero(self.effect):
            candidate, unknown = own[stems[i]]
            if unknown.null is not None:
                size = geometry.size(candidate, unknown)
                mean[i], precision[i, i] = unknown.null, size.scale**-2
                self.amplitude[i], self.freedom[i] = True, size.freedom
                self.peak += size.peak
            else:
                mean[i], width = _range_of(rows, unknown, setting.values[plain.names[i]])
                precision[i, i] = 12.0 / width**2
        self.prior = replace(plain, mean=mean, precision=precision)
        ridge = np.diag(1e-12 / plain.size**2)
        self.stated = precision + ridge
        self._sensor = np.array([name.startswith(ERROR) for name in plain.names])
        self._plant = ~self.effect & ~self._sensor & (np.diag(precision) > 0)
        at = np.flatnonzero(self._plant)
        self._size = np.sqrt(np.diag(precision))[at]
        between = precision[np.ix_(at, at)] / np.outer(self._size, self._size)
        self._parts, self._ways = np.linalg.eigh(between)

    def density(self, at: Array) -> tuple[float, Array]:
        """Log density, less that of the normal one at its mean, and the precision it has there."""
        off = at - self.prior.mean
        precision = self.stated.copy()
        plant = np.flatnonzero(self._plant)
        far = np.sqrt(np.maximum(self._parts, 0.0)) * (self._ways.T @ (self._size * off[plant]))
        tails = -0.5 * (FREEDOM + 1.0) * float(np.sum(np.log1p(far**2 / FREEDOM)))
        weight = self._parts * (FREEDOM + 1.0) / (FREEDOM + far**2)
        outer = np.outer(self._size, self._size)
        precision[np.ix_(plant, plant)] = (self._ways * weight) @ self._ways.T * outer
        size = off**2 * np.diag(self.stated)
        wide = np.flatnonzero(self.amplitude)
        free = self.freedom[wide]
        tails -= 0.5 * float(np.sum((free + 1.0) * np.log1p(size[wide] / free)))
        precision[wide, wide] *= (free + 1.0) / (free + size[wide])
        rest = ~self._plant & ~self.amplitude
        return tails - 0.5 * float(np.sum(size[rest])), precision


def _range_of(rows: Rows, unknown: Unknown, start: float) -> tuple[float, float]:
    """Middle and width of the range in which a shape lies."""
    data = rows.system.data
    if unknown.driver is not None:
        clock = data.time - data.time[0]
        values = clock if unknown.driver == TIME else data.values[unknown.driver]
        low, high = np.nanquantile(values, [0.02, 0.98])
        return float(low + high) / 2, max(float(high - low), 1e-12)
    width = 2.0 * max((abs(s) for s in unknown.starts), default=abs(start)) or 1.0
    return float(np.sign(start) or 1.0) * width / 2, width


@dataclass(frozen=True)
class _Chosen:
    """Error of form, sizes of terms, noise, and the linear solution with them."""

    score: float
    form: float
    sizes: tuple[float, ...]
    scale: float
    solution: Array
    weights: Array
    table: Array


def refitted(
    geometry: Geometry,
    setting: Configuration,
    near: Model | None = None,
    terms: tuple[Term, ...] = (),
    steps: int = 25,
) -> Model:
    """Refit all values, errors of form among them; `near` is a model that is much alike."""
    rows, seen = geometry.rows, geometry.seen
    known = _Prior(geometry, setting)
    prior, n = known.prior, len(known.prior.names)
    values = [setting.values.get(a, m) for a, m in zip(prior.names, prior.mean, strict=True)]
    at = np.clip(np.array(values), prior.lowest, prior.highest)
    random = Random(geometry.forms, terms)
    forms = np.zeros(random.count)
    if near is not None:
        kept = min(len(forms), len(near.forms))
        forms[:kept] = near.forms[:kept]
    form, scale = (0.004, 1.0) if near is None else (near.form, near.scale)
    sizes = tuple(1.0 for _ in terms)
    now = _evaluated(rows, setting, prior, at)
    damping, cost = 1e-3, np.inf
    for step in range(steps):
        if step in (0, 4):
            begin = at, forms, form, sizes
            found = _choose(geometry, known, random, now, begin, np.zeros((int(seen.sum()), 0)))
            form, scale, forms = found.form, found.scale, found.solution[n:]
            sizes = found.sizes
            loads = random.loads(form, sizes)
            cost = _cost(geometry, known, now, at, forms, loads, scale)
        residual = now.residual[seen] + loads @ forms
        table = np.concatenate([now.jacobian[seen], loads], axis=1)
        weights = geometry.weights(residual, scale)
        precision = np.eye(table.shape[1])
        precision[:n, :n] = known.density(at)[1]
        normal = table.T @ (table * weights[:, None]) + precision
        slope = table.T @ (weights * residual)
        slope += precision @ np.concatenate([at - prior.mean, forms])
        stopped = np.zeros(len(slope), dtype=bool)
        stopped[:n] = (at <= prior.lowest) & (slope[:n] > 0)
        stopped[:n] |= (at >= prior.highest) & (slope[:n] < 0)
        free = np.flatnonzero(~stopped)
        size = np.sqrt(np.diag(normal))[free]
        scaled = normal[np.ix_(free, free)] / np.outer(size, size)
        gain = -1.0
        for _ in range(10):
            change = np.zeros(len(slope))
            damped = scaled + damping * np.eye(len(free))
            change[free] = -np.linalg.solve(damped, slope[free] / size) / size
            there = np.clip(at + change[:n], prior.lowest, prior.highest)
            moved = forms + change[n:]
            trial = _evaluated(rows, setting, prior, there)
            after = _cost(geometry, known, trial, there, moved, loads, scale)
            gain = cost - after if np.isfinite(after) else -1.0
            if gain >= -1e-9:
                at, forms, now, cost = there, moved, trial, after
                damping = max(damping / 8.0, 1e-9)
                break
            damping = max(damping, 1e-6) * 8.0
        if gain < 1e-2:
            break
    return _weighed(geometry, known, random, now, (at, forms, form, sizes))


def _evaluated(rows: Rows, setting: Configuration, prior: Prior, at: Array) -> Fitted:
    return steady._evaluated(rows, setting, prior, at, rows.system.data.open, 1.0, None)


def _cost(
    geometry: Geometry,
    known: _Prior,
    now: Fitted,
    at: Array,
    forms: Array,
    loads: Array,
    scale: float,
) -> float:
    residual = now.residual[geometry.seen] + loads @ forms
    likelihood = geometry.likelihood(residual, scale)
    return -likelihood - known.density(at)[0] + 0.5 * float(forms @ forms)


Begin = tuple[Array, Array, float, tuple[float, ...]]
"""Values, random numbers, error of form and sizes of terms to begin with."""


def _choose(
    geometry: Geometry, known: _Prior, random: Random, now: Fitted, begin: Begin, more: Array
) -> _Chosen:
    """Error of form, sizes of terms and noise under which the recording is most probable.

    `more` are columns of errors of the effects' own forms.
    """
    at, forms, form, sizes = begin
    n = len(at)
    jacobian = now.jacobian[geometry.seen]
    off = at - known.prior.mean
    left = now.residual[geometry.seen] - jacobian @ off
    table = np.concatenate([jacobian, random.loads(1.0, [1.0] * len(sizes)), more], axis=1)
    precision = _joint(known.density(at)[1], random.count, more.shape[1])
    begun = random.ratio(form, sizes) * forms
    start = np.concatenate([off, begun, np.zeros(more.shape[1])])
    best: _Chosen | None = None

    def tried(
        form: float, sizes: tuple[float, ...], scale: float, known_: tuple[Array, ...]
    ) -> None:
        nonlocal best
        normal, moment, weights = known_
        ratio = np.ones(len(precision))
        ratio[n : n + random.count] = random.ratio(form, sizes)
        whole = normal * np.outer(ratio, ratio) + precision
        size = np.sqrt(np.diag(whole))
        factor = cho_factor(whole / np.outer(size, size) + 1e-13 * np.eye(len(size)))
        solution = -cho_solve(factor, moment * ratio / size) / size
        residual = left + table @ (ratio * solution)
        score = geometry.likelihood(residual, scale) - 0.5 * float(solution @ precision @ solution)
        score -= float(np.sum(np.log(np.diag(factor[0]))) + np.sum(np.log(size)))
        score -= 0.5 * (form / FORM) ** 2 + 0.5 * (np.log(scale) / np.log(1.5)) ** 2
        if best is None or score > best.score:
            best = _Chosen(score, form, sizes, scale, solution, weights, table * ratio)

    def products(weights: Array) -> tuple[Array, ...]:
        return table.T @ (table * weights[:, None]), table.T @ (weights * left), weights

    for scale in SCALES.tolist():
        parts = products(geometry.weights(left + table @ start, scale))
        for share in FORMS.tolist():
            tried(share, sizes, scale, parts)
    assert best is not None
    for i in range(len(sizes)):
        parts = products(best.weights)
        for size in SIZES.tolist():
            for share in FORMS.tolist():
                tried(share, (*best.sizes[:i], size, *best.sizes[i + 1 :]), best.scale, parts)
    for _ in range(3):
        before = best
        parts = products(geometry.weights(left + best.table @ best.solution, best.scale))
        tried(best.form, best.sizes, best.scale, parts)
        if best is before:
            break
    return best


def _joint(values: Array, forms: int, more: int) -> Array:
    """Precision of values, of errors of form and of those of the effects' forms."""
    n = len(values)
    joint = np.eye(n + forms + more)
    joint[:n, :n] = values
    joint[n + forms :, n + forms :] *= EFFECT_FORM**-2
    return joint


def _weighed(geometry: Geometry, known: _Prior, random: Random, now: Fitted, begin: Begin) -> Model:
    at = begin[0]
    more = forms_of_effects(geometry, now)
    found = _choose(geometry, known, random, now, begin, more)
    density, tangent = known.density(at)
    off = at - known.prior.mean
    jacobian = now.jacobian[geometry.seen]
    # The normal density of the linear solution gives way to that of the Student distribution.
    evidence = found.score + density + 0.5 * float(off @ tangent @ off)
    stated = _joint(known.stated, random.count, more.shape[1])
    evidence += 0.5 * float(np.linalg.slogdet(stated)[1])
    evidence += known.peak
    evidence -= len(random.terms) * float(np.log(len(SIZES)))
    return Model(
        fitted=now,
        prior=known.prior,
        at=at,
        forms=begin[1],
        terms=random.terms,
        form=found.form,
        scale=found.scale,
        evidence=evidence,
        table=found.table,
        left=now.residual[geometry.seen] - jacobian @ off,
        precision=_joint(tangent, random.count, more.shape[1]),
        weights=found.weights,
    )


def forms_of_effects(geometry: Geometry, now: Fitted) -> Array:
    """Each effect's own term times smooth functions of its drivers, shape (rows, functions)."""
    rows, setting = geometry.rows, now.setting
    system, columns = rows.system, []
    for candidate in setting.joined:
        null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
        if not null or candidate.sort == "fault":
            continue
        modules = system.reached(candidate.observers)
        bare = replace(setting, values={**setting.values, **null})
        there, plain = (
            system.flows(s, at=now.predicted, modules=modules).values for s in (setting, bare)
        )
        term = {
            i: np.nan_to_num(v) for i, v in enumerate(there - plain) if np.any(np.nan_to_num(v))
        }
        for name in dict.fromkeys(candidate.drivers.values()):
            for shape in _shapes(system.inputs[name]):
                column = rows.column(now.maps, {i: v * shape for i, v in term.items()})
                columns.append(column[geometry.seen])
    return np.stack(columns, axis=1) if columns else np.zeros((int(geometry.seen.sum()), 0))


def _shapes(driver: Array | float) -> Sequence[Array]:
    """A bend and an S over the range of a driver, of unit size."""
    values = np.asarray(driver, dtype=float)
    values = np.nan_to_num(values, nan=float(np.nanmedian(values)))
    low, high = np.quantile(values, [0.02, 0.98])
    if high <= low:
        return ()
    z = np.clip(2.0 * (values - low) / (high - low) - 1.0, -1.2, 1.2)
    return np.sqrt(5.0) * (3.0 * z**2 - 1.0) / 4.0, np.sqrt(7.0) * (5.0 * z**3 - 3.0 * z) / 4.0
