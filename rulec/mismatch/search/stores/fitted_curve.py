"""A curve over a driver at a place of a plant that stores, fitted beside all else by simulation.

Its functions are those of a term without a name at settled points; how large and how smooth it is
follows from the recording.

Source: Rasmussen and Williams 2006, chapter 5 (sizes and lengths by evidence), about the model made
linear at its optimum.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import Spot
from rulec.mismatch.evidence.stores.final_fits import FinalFits, fixed_values
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise, gain
from rulec.mismatch.search import limits
from rulec.mismatch.search.basis import Basis
from rulec.mismatch.search.stores.place import Place, place_over


@dataclass(frozen=True)
class Form:
    """Functions at the knots, times their size: shape (knots, functions), SI of the place."""

    basis: Basis
    size: float
    table: Array


@dataclass(frozen=True)
class FittedCurve:
    """A curve that was fitted, with all else that its model holds.

    `amounts`, shape (functions,), are those of `form`, with unit prior. `at` are the free values of
    `fitter`; `judged` says how samples count. `gain` is that over the model without it, paid for.
    """

    place: Place
    form: Form
    amounts: Array
    fitter: Fitter
    fitted: Fitted
    judged: Judged
    gain: float

    @property
    def at(self) -> Array:
        """The free values, SI, shape (free,)."""
        return self.fitter.vector(self.fitted.values)

    def value(self, driver: Array) -> Array:
        """The curve over its driver, SI, shape of `driver`."""
        return np.asarray(np.interp(driver, self.place.knots, self.form.table @ self.amounts))


@dataclass(frozen=True)
class System:
    """A model with a curve, made linear; the first of `plain` and `own` are rows of readings.

    `left`, shape (rows,), is what is left without a curve, `plain`, shape (rows, values), are the
    slopes by all other free values, per step that matters, `own`, shape (rows, knots), those by the
    curve at its knots, SI.
    """

    left: Array
    plain: Array
    own: Array


def _fitter(ends: FinalFits, bare: Fitted, place: Place) -> Fitter:
    """What fits a curve beside all that a model holds."""
    parts, knots = place.parts(ends.bench.builder)
    return Fitter(ends.bench, (*bare.joined, *parts), {**fixed_values(bare), **knots})


def fitted_curve(ends: FinalFits, bare: Fitted, spot: Spot, driver: str) -> FittedCurve | None:
    """A curve fitted beside all that a model holds; None where nothing comes of it.

    Beside a curve a state may run through another range, over which the curve is then drawn anew.
    """
    bench, found = ends.bench, list[FittedCurve]()
    with contextlib.suppress(RanAway):
        for _ in range(limits.REDRAWN):
            last = found[-1] if found else None
            model = last.fitted if last else bare
            course = bench.trajectory(model.ids, model.values, driver, model.inputs)
            place = place_over(spot, driver, course[bench.record.open])
            if place is None or (last is not None and _as_wide(place, last.place)):
                break
            found.append(_drawn(ends, bare, place, last))
    return max(found, key=lambda d: d.gain, default=None)


def _as_wide(place: Place, other: Place) -> bool:
    off = max(abs(place.low - other.low), abs(place.high - other.high))
    return off < limits.AS_WIDE * (other.high - other.low)


def _drawn(ends: FinalFits, bare: Fitted, place: Place, before: FittedCurve | None) -> FittedCurve:
    """A curve with knots where they stand, from nothing or from one with others."""
    fitter = _fitter(ends, bare, place)
    near = bare if before is None else before.fitted
    judged = replace(ends.judged, noise=near.noise, slow=near.slow, drift=bare.drift)
    values = np.zeros(len(place.knots)) if before is None else before.value(place.knots)
    at = fitter.vector(near.values)
    count = len(at) - len(place.bends)
    at[count:] = place.bends @ values
    for _ in range(limits.CURVE_ROUNDS):
        system = system_at(fitter, at, place, judged)
        noise = judged.noise
        _, form, share = _likeliest(system, place, _news(ends, judged))
        judged = replace(judged, noise=_less(noise, share))
        amounts = np.asarray(np.linalg.lstsq(form.table, values, rcond=None)[0])
        at[count:] = place.bends @ form.table @ amounts
        at, amounts = _descended(fitter, at, amounts, place, form, judged)
        values = form.table @ amounts
        errors, slow, judged = fitter.looked_at(at, judged)
        if all(_same(noise[n].weight, own.weight) for n, own in judged.noise.items()):
            break
    fitted = fitter.as_fitted(at, errors, slow, judged)
    inverse = inverse_of(*rows_of(system_at(fitter, at, place, judged), form))
    told = len(amounts) - float(np.trace(inverse[count:, count:]))
    gained = _gained(ends, fitted, bare, told)
    return FittedCurve(place, form, amounts, fitter, fitted, judged, gained)


def _news(ends: FinalFits, judged: Judged) -> float:
    """Independent pieces of news in the recording, as samples count."""
    return sum(ends.samples[n] / noise.memory for n, noise in judged.noise.items())


def _less(noise: Mapping[str, Noise], share: float) -> dict[str, Noise]:
    """A share of the noise."""
    return {n: Noise(share * own.spread, own.memory) for n, own in noise.items()}


def _same(before: float, after: float) -> bool:
    """Does noise stay as it was?"""
    return abs(before - after) < limits.NOISE_STAYS * before


def _gained(ends: FinalFits, fitted: Fitted, bare: Fitted, values: float) -> float:
    """What a curve gains over the model without it; as many values as the recording tells of it
    are paid for, as if each had been found alone."""
    found = sum(gain(bare.noise[n], fitted.noise[n], ends.samples[n]) for n in bare.noise)
    found += bare.negative_log_prior - fitted.negative_log_prior
    each = 0.5 * float(np.log(max(ends.news(fitted), 2.0)))
    return found - each * values - limits.RARITY["free"]


def system_at(fitter: Fitter, at: Array, place: Place, judged: Judged) -> System:
    """A model with a curve made linear at a point."""
    residual, slopes = fitter.residual(at, judged, judged.basis())
    count = slopes.shape[1] - len(place.bends)
    by_coefficient = slopes[:, count:] / fitter.scale[count:]
    own = by_coefficient @ place.bends
    return System(residual - by_coefficient @ at[count:], slopes[:, :count], own)


def rows_of(system: System, form: Form) -> tuple[Array, Array]:
    """Slopes by all other values and by amounts of functions, shape (rows, values), and how sure
    those are before, shape (values,)."""
    own = system.own @ form.table
    known = np.concatenate([np.zeros(system.plain.shape[1]), np.ones(own.shape[1])])
    return np.column_stack([system.plain, own]), known


def inverse_of(table: Array, known: Array) -> Array:
    """Inverse of the normal matrix of columns, shape (rows, values), with what is known before."""
    normal = table.T @ table + np.diag(known)
    unit = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(unit, unit) + 1e-12 * np.eye(len(unit))
    inverse: Array = np.linalg.inv(scaled) / np.outer(unit, unit)
    return inverse


def _likeliest(system: System, place: Place, news: float) -> tuple[float, Form, float]:
    """The size and smoothness of a curve that make a recording most likely, and by how much more
    than without any curve, in nats; and what noise falls to with it, as share of that before.

    `news` is the number of independent pieces of news. The noise is found with the curve: what is
    left without one says little of what is left beside it.
    """
    q, _ = np.linalg.qr(system.plain)
    left = system.left - q @ (q.T @ system.left)
    whole = float(left @ left)
    best: tuple[float, Form, float] | None = None
    for basis in place.bases():
        table = basis.at(place.knots)
        rows = system.own @ table
        norm = float(np.sqrt(np.mean(rows[:, 0] ** 2))) or 1.0
        rows = (rows - q @ (q.T @ rows)) / norm
        own, ways = np.linalg.eigh(rows.T @ rows)
        square, own = (ways.T @ (rows.T @ left)) ** 2, np.maximum(own, 0.0)
        for size in limits.TERM_SIZES:
            for noise in limits.NOISE_FALLS:
                seen = own * (size / noise) ** 2
                rest = whole - float(np.sum(square * size**2 / (noise**2 + own * size**2)))
                gained = 0.5 * (whole - rest / noise**2) - news * float(np.log(noise))
                gained -= 0.5 * float(np.sum(np.log1p(seen)))
                if best is None or gained > best[0]:
                    best = gained, Form(basis, size / norm, table * (size / norm)), noise
    assert best is not None
    return best


def _descended(
    fitter: Fitter, at: Array, amounts: Array, place: Place, form: Form, judged: Judged
) -> tuple[Array, Array]:
    """The optimum of all values and of a curve near a point (Gauss, Newton)."""
    basis = judged.basis()
    cost = fitter.cost(at, judged, basis) + 0.5 * float(amounts @ amounts)
    for _ in range(limits.CURVE_STEPS):
        system = system_at(fitter, at, place, judged)
        table, known = rows_of(system, form)
        found = -inverse_of(table, known) @ (table.T @ system.left)
        count = system.plain.shape[1]
        for share in limits.STEP_SHARES:
            there = amounts + share * (found[count:] - amounts)
            point = at.copy()
            point[:count] += share * found[:count] * fitter.scale[:count]
            point = fitter.within(point)
            point[count:] = place.bends @ form.table @ there
            now = fitter.cost(point, judged, basis) + 0.5 * float(there @ there)
            if now < cost:
                break
        else:
            break
        ended = cost - now < limits.CURVE_CONVERGED
        at, amounts, cost = point, there, now
        if ended:
            break
    return at, amounts
