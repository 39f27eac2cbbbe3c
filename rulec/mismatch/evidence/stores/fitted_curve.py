"""A curve over a driver at a place of a plant that stores, fitted by simulation beside all else.

Its functions are those of a term without a name at settled points; its size and smoothness are
estimated.

Source: Rasmussen and Williams 2006, chapter 5 (sizes and lengths by evidence), with the model
linearised at its optimum.
"""

import contextlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import TIME, RanAway

from rulec.effects.candidate import Candidate, DisturbanceLocation
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.evidence.term import Basis


@dataclass(frozen=True)
class Domain:
    """The place of a curve, its driver, and the range of that, SI."""

    location: DisturbanceLocation
    driver: str
    low: float
    high: float

    @property
    def knots(self) -> Array:
        """Values of the driver at which the curve bends, shape (knots,), SI."""
        return np.linspace(self.low, self.high, limits.CURVE_PIECES + 1)

    @cached_property
    def bends(self) -> Array:
        """Map from values at the knots to the coefficients of `bent_line`, shape (knots + 1,
        knots)."""
        values = np.eye(len(self.knots))
        steps = np.diff(values, axis=0) / (self.knots[1] - self.knots[0])
        slopes = np.pad(steps, ((1, 1), (0, 0)))
        return np.vstack([values[:1], np.diff(slopes, axis=0)])

    def bases(self) -> list[Basis]:
        """The functions to try, from smooth to rough."""
        # An effect in a band of a driver may be a resonance; in a band of time it is a fault.
        lengths = limits.TERM_LENGTHS[: 1 if self.driver == TIME else None]
        return [Basis(self.low, self.high, length) for length in lengths]

    def parts(self, builder: ModelBuilder) -> tuple[tuple[Candidate, ...], dict[str, float]]:
        """Candidates that add the curve to a plant, and its knots, SI by id."""
        parts = builder.bent_line(self.location.id, self.driver, len(self.knots))
        fixed = [u.id for part in parts for u in part.unknowns if u.fixed]
        return parts, dict(zip(fixed, self.knots.tolist(), strict=True))


def domain_over(location: DisturbanceLocation, driver: str, course: Array) -> Domain | None:
    """A place with the range of a driver, by its course, shape (n,); None if that hardly moves.

    The whole range counts: samples beyond the knots would distort a curve that is constant there.
    """
    low, high = float(np.min(course)), float(np.max(course))
    if not high - low > limits.HARDLY_MOVES * float(np.max(np.abs(course))):
        return None
    return Domain(location, driver, low, high)


@dataclass(frozen=True)
class Form:
    """Functions at the knots, times their size: shape (knots, functions), SI of the place."""

    basis: Basis
    size: float
    table: Array


@dataclass(frozen=True)
class FittedCurve:
    """A fitted curve, with all else in its model.

    `amounts`, shape (functions,), are those of `form`, with unit prior. `gain` is that over the
    model without the curve, less its penalty.
    """

    domain: Domain
    form: Form
    amounts: Array
    fitted: Fitted
    gain: float

    @cached_property
    def rows(self) -> tuple[Array, Array]:
        """Slopes by all other values and by the amounts, shape (rows, values), and their prior
        precision, shape (values,)."""
        model = self.fitted
        return linear_at(model.fitter, model.at, self.domain, model.judged).with_form(self.form)

    def functions_at(self, driver: Array) -> Array:
        """Its functions at values of the driver, shape (n, functions), SI of its place."""
        knots = self.domain.knots
        return np.stack([np.interp(driver, knots, own) for own in self.form.table.T], axis=1)

    def value(self, driver: Array) -> Array:
        """The curve over its driver, SI, shape of `driver`."""
        return np.asarray(np.interp(driver, self.domain.knots, self.form.table @ self.amounts))


def fitted_curve(bare: Fitted, location: DisturbanceLocation, driver: str) -> FittedCurve | None:
    """A curve fitted beside all else in a model; None where that fails.

    A curve may change the range of a state, and is then fitted again over the new range.
    """
    found = list[FittedCurve]()
    with contextlib.suppress(RanAway):
        for _ in range(limits.REDRAWN):
            last = found[-1] if found else None
            course = (last.fitted if last else bare).course(driver)
            domain = domain_over(location, driver, course[bare.problem.record.open])
            if domain is None or (last is not None and _same_range(domain, last.domain)):
                break
            found.append(_fitted_over(bare, domain, last))
    return max(found, key=lambda curve: curve.gain, default=None)


def _same_range(domain: Domain, other: Domain) -> bool:
    off = max(abs(domain.low - other.low), abs(domain.high - other.high))
    return off < limits.AS_WIDE * (other.high - other.low)


def _fitted_over(bare: Fitted, domain: Domain, before: FittedCurve | None) -> FittedCurve:
    """Fit a curve with fixed knots, starting from zero or from a curve with other knots."""
    parts, knots = domain.parts(bare.problem.builder)
    fitter = Fitter(bare.problem, (*bare.joined, *parts), {**bare.values, **knots})
    near = bare if before is None else before.fitted
    values = np.zeros(len(domain.knots)) if before is None else before.value(domain.knots)
    at, judged = fitter.vector(near.values), near.judged
    count = len(fitter.free) - len(domain.bends)
    at[count:] = domain.bends @ values
    for _ in range(limits.CURVE_ROUNDS):
        noise = judged.noise
        effective_size = sum(judged.samples[n] / own.correlation_time for n, own in noise.items())
        form, share = _likeliest(linear_at(fitter, at, domain, judged), domain, effective_size)
        less = {n: Noise(share * own.spread, own.correlation_time) for n, own in noise.items()}
        judged = replace(judged, noise=less)
        amounts = np.asarray(np.linalg.lstsq(form.table, values, rcond=None)[0])
        at[count:] = domain.bends @ form.table @ amounts
        at, amounts = _descended(fitter, at, amounts, domain, form, judged)
        values = form.table @ amounts
        fitted = fitter.fitted_at(at, judged)
        judged = fitted.judged
        before_and_after = ((noise[n].weight, own.weight) for n, own in judged.noise.items())
        if all(abs(old - new) < limits.NOISE_STAYS * old for old, new in before_and_after):
            break
    inverse = inverse_of(*linear_at(fitter, at, domain, judged).with_form(form))
    determined = len(amounts) - float(np.trace(inverse[count:, count:]))
    gained = fitted.gain(bare, determined) - limits.CURVE_RARITY
    return FittedCurve(domain, form, amounts, fitted, gained)


@dataclass(frozen=True)
class Linear:
    """A linearised model with a curve; the rows of readings come first.

    `left`, shape (rows,), is the residual without the curve. `plain`, shape (rows, values), are the
    slopes by all other free values, scaled; `own`, shape (rows, knots), are those by the curve at
    its knots, SI.
    """

    left: Array
    plain: Array
    own: Array

    def with_form(self, form: Form) -> tuple[Array, Array]:
        """Slopes by all other values and by the amounts of functions, shape (rows, values), and
        their prior precision, shape (values,)."""
        own = self.own @ form.table
        precision = np.concatenate([np.zeros(self.plain.shape[1]), np.ones(own.shape[1])])
        return np.column_stack([self.plain, own]), precision


def linear_at(fitter: Fitter, at: Array, domain: Domain, judged: Judged) -> Linear:
    """Linearise a model with a curve at a point."""
    residual, slopes = fitter.residual(at, judged)
    count = slopes.shape[1] - len(domain.bends)
    by_coefficient = slopes[:, count:] / fitter.scale[count:]
    left = residual - by_coefficient @ at[count:]
    return Linear(left, slopes[:, :count], by_coefficient @ domain.bends)


def inverse_of(table: Array, precision: Array) -> Array:
    """Inverse of the normal matrix of columns, shape (rows, values), with a prior precision."""
    normal = table.T @ table + np.diag(precision)
    unit = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(unit, unit) + 1e-12 * np.eye(len(unit))
    return np.asarray(np.linalg.inv(scaled) / np.outer(unit, unit))


def _likeliest(system: Linear, domain: Domain, effective_size: float) -> tuple[Form, float]:
    """The likeliest size and smoothness of a curve, and the noise as a share of that without it.

    `effective_size` counts independent samples. The noise is estimated with the curve, as the
    residual without it says little about the residual with it.
    """
    q, _ = np.linalg.qr(system.plain)
    left = system.left - q @ (q.T @ system.left)
    whole = float(left @ left)
    best: tuple[float, Form, float] | None = None
    for basis in domain.bases():
        table = basis.at(domain.knots)
        rows = system.own @ table
        norm = float(np.sqrt(np.mean(rows[:, 0] ** 2))) or 1.0
        rows = (rows - q @ (q.T @ rows)) / norm
        own, ways = np.linalg.eigh(rows.T @ rows)
        square, own = (ways.T @ (rows.T @ left)) ** 2, np.maximum(own, 0.0)
        for size in common.TERM_SIZES:
            for noise in limits.NOISE_FALLS:
                rest = whole - float(np.sum(square * size**2 / (noise**2 + own * size**2)))
                gained = 0.5 * (whole - rest / noise**2) - effective_size * float(np.log(noise))
                gained -= 0.5 * float(np.sum(np.log1p(own * (size / noise) ** 2)))
                if best is None or gained > best[0]:
                    best = gained, Form(basis, size / norm, table * (size / norm)), noise
    assert best is not None
    return best[1:]


def _descended(
    fitter: Fitter, at: Array, amounts: Array, domain: Domain, form: Form, judged: Judged
) -> tuple[Array, Array]:
    """Gauss-Newton steps in all values and the curve."""
    cost = fitter.cost(at, judged) + 0.5 * float(amounts @ amounts)
    for _ in range(limits.CURVE_STEPS):
        system = linear_at(fitter, at, domain, judged)
        table, precision = system.with_form(form)
        found = -inverse_of(table, precision) @ (table.T @ system.left)
        count = system.plain.shape[1]
        for share in limits.STEP_SHARES:
            there = amounts + share * (found[count:] - amounts)
            point = at.copy()
            point[:count] += share * found[:count] * fitter.scale[:count]
            point = fitter.clipped(point)
            point[count:] = domain.bends @ form.table @ there
            now = fitter.cost(point, judged) + 0.5 * float(there @ there)
            if now < cost:
                break
        else:
            break
        ended = cost - now < limits.CURVE_CONVERGED
        at, amounts, cost = point, there, now
        if ended:
            break
    return at, amounts
