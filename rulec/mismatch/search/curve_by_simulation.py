"""The values of a curve over its driver in a plant that stores, and its two branches.

Residuals are correlated in time, so uncertainties follow from their autocorrelation, not from the
number of samples.

Source: sandwich covariance (White 1982; with autocorrelation Newey and West 1987).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import white_noise
from rulec_runtime.simulation.balances import TIME, RanAway

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.fitted_curve import FittedCurve, inverse_of, rows_of, system_at
from rulec.mismatch.evidence.stores.model import response
from rulec.mismatch.evidence.stores.noise import score_covariance
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.evidence.term import basis_over, ways_there
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_found import (
    Branches,
    CurveFound,
    counted_visits,
    means_of_visits,
)


def curve_of(bench: SimulationProblem, drawn: FittedCurve) -> CurveFound:
    """A curve with its covariance, all else in its model refitted beside it.

    The axis of a state with a recorded reading is that reading: the scale of a level is often
    hardly known, but its reading is.
    """
    place, count = drawn.place, len(drawn.amounts)
    system = system_at(drawn.fitter, drawn.at, place, drawn.judged)
    rows = rows_of(system, drawn.form)
    # The range of the driver in the final model, as far as the curve has knots there.
    final = basis_over(course_of(bench, drawn)[bench.record.open], drawn.form.basis.length)
    low, high = max(place.low, final.low), min(place.high, final.high)
    at = np.linspace(low, high, limits.CURVE_POINTS)
    there = _at(drawn, at)
    covariance = _covariance(bench, drawn, *rows)[-count:, -count:]
    means = _means(bench, drawn, *rows)
    axis = axis_of(bench, drawn)
    means[:, 0] = axis.over(means[:, 0])
    return CurveFound(
        place=place.spot,
        driver=axis.name,
        at=axis.over(at),
        value=there @ drawn.amounts,
        covariance=there @ covariance @ there.T,
        means=means,
        branches=_branches(bench, drawn, *rows),
    )


@dataclass(frozen=True)
class Axis:
    """The axis of a curve: `shown`, shape (k,), SI, at values `at` of its driver."""

    name: str
    at: Array
    shown: Array

    def over(self, driver: Array) -> Array:
        """Values of the driver on this axis, SI, shape of `driver`."""
        return np.asarray(np.interp(driver, self.at, self.shown))


def axis_of(bench: SimulationProblem, drawn: FittedCurve) -> Axis:
    """The reading of a state, the time of the recording, or the driver itself."""
    driver, fitted = drawn.place.driver, drawn.fitted
    at, order = np.unique(course_of(bench, drawn), return_index=True)
    if driver == TIME:
        return Axis(driver, at, at + float(bench.record.time[0]))
    for name in () if driver in bench.record.inputs else bench.signals:
        shown = bench.trajectory(fitted.ids, fitted.values, name, fitted.inputs)[order]
        if (np.diff(shown) > 0.0).all():
            return Axis(name, at, shown)
    return Axis(driver, at, at)


def _at(drawn: FittedCurve, driver: Array) -> Array:
    """Functions of a curve at values of its driver, shape (n, functions), SI of its place."""
    knots = drawn.place.knots
    functions = [np.interp(driver, knots, column) for column in drawn.form.table.T]
    return np.stack(functions, axis=1)


def _covariance(bench: SimulationProblem, drawn: FittedCurve, table: Array, known: Array) -> Array:
    """Covariance of all values, shape (values, values), with correlated errors and the prior of the
    fit; `table` and `known` are as in `rows_of`."""
    inverse = inverse_of(table, known)
    judged, errors = drawn.judged, drawn.fitted.errors
    of_readings = int(judged.flags().sum())
    middle = np.diag(known) + table[of_readings:].T @ table[of_readings:]
    first = 0
    for name in bench.signals:
        flags = judged.known[name]
        columns = np.zeros((len(flags), table.shape[1]))
        columns[flags] = table[first : first + int(flags.sum())]
        first += int(flags.sum())
        per_variance = score_covariance(columns, errors[name], flags)
        middle += per_variance / judged.noise[name].memory
    return np.asarray(inverse @ middle @ inverse)


def course_of(bench: SimulationProblem, drawn: FittedCurve) -> Array:
    """Course of the driver in the model with the curve, shape (n,), SI."""
    fitted = drawn.fitted
    return bench.trajectory(fitted.ids, fitted.values, drawn.place.driver, fitted.inputs)


def _means(bench: SimulationProblem, drawn: FittedCurve, table: Array, known: Array) -> Array:
    """Driver, value and uncertainty in stretches of time beside the curve, shape (stretches, 3).

    The prior of each deviates from the curve by its height; only stretches that determine the value
    much better are reported.
    """
    height = float(np.std(drawn.form.table @ drawn.amounts))
    found = response(bench, drawn.fitted, drawn.place.spot, common.COURSE_KNOTS[0])
    if found is None or not height > 0.0:
        return np.zeros((0, 3))
    moved, shapes, size = found
    judged = drawn.judged
    columns = drawn.fitter.as_rows(moved * (height / size), judged)
    whole = np.column_stack([table, columns])
    prior = np.concatenate([known, np.ones(len(shapes))])
    inverse = inverse_of(whole, prior)
    left = drawn.fitter.residual(drawn.at, judged, judged.basis())[0]
    off = -inverse @ (whole.T @ left)
    course = course_of(bench, drawn)
    mean = np.stack(shapes) / np.sum(shapes, axis=1)[:, None]
    ways = np.zeros((len(shapes), whole.shape[1]))
    first, count = table.shape[1], len(drawn.amounts)
    ways[:, first - count : first] = mean @ _at(drawn, course)
    ways[:, first:] = height * np.eye(len(shapes))
    off[first - count : first] = drawn.amounts
    u = np.sqrt(np.einsum("ij,jk,ik->i", ways, inverse, ways))
    determined = u**2 < 0.5 * height**2
    return np.asarray(np.stack([mean @ course, ways @ off, u], axis=1)[determined])


def _branches(
    bench: SimulationProblem, drawn: FittedCurve, table: Array, known: Array
) -> Branches | None:
    """The gap between both branches, with the curve and everything else refitted beside it; None
    without a clock or with too few visits on either branch."""
    driver = drawn.place.driver
    if driver == TIME or not bench.record.timed:
        return None
    course = course_of(bench, drawn)
    given = bench.record.inputs.get(driver)
    # A simulated state has no noise.
    noise = 0.0 if given is None else white_noise(np.diff(given, 3), 3)
    side, visit = ways_there(course, noise)
    known = bench.record.open & np.isfinite(course) & (side != 0)
    if not known.any():
        return None
    counts = counted_visits(*means_of_visits(visit, known, np.ones(len(course)), course, side))
    if counts is None:
        return None
    fitted, spot = drawn.fitted, drawn.place.spot
    height = float(np.ptp(drawn.form.table @ drawn.amounts))
    step = common.GENTLE * height
    inputs = ({**fitted.inputs, spot.unknown: error * side} for error in (step, 0.0))
    try:
        moved, plain = (
            bench.simulate(fitted.ids, fitted.values, inputs=own, spots=(spot.id,)).stacked
            for own in inputs
        )
    except RanAway:
        return None
    judged = drawn.judged
    column = drawn.fitter.as_rows((moved - plain)[:, None] / step, judged)
    whole, prior = np.column_stack([column, table]), np.concatenate([[0.0], known])
    left = drawn.fitter.residual(drawn.at, judged, judged.basis())[0]
    gradient = whole.T @ left
    gradient[-len(drawn.amounts) :] += drawn.amounts
    gap = -2.0 * float((inverse_of(whole, prior) @ gradient)[0])
    u = 2.0 * float(np.sqrt(_covariance(bench, drawn, whole, prior)[0, 0]))
    return Branches(gap=gap, u=u, rising=counts[0], falling=counts[1])
