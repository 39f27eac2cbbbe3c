"""The values of a curve over its driver in a plant that stores, and its two branches.

Residuals are correlated in time, so uncertainties follow from their autocorrelation, not from the
number of samples.

Source: sandwich covariance (White 1982; with autocorrelation Newey and West 1987).
"""

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import white_noise
from rulec_runtime.simulation.balances import TIME, RanAway

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.fitted_curve import FittedCurve, inverse_of
from rulec.mismatch.evidence.stores.noise import score_covariance
from rulec.mismatch.evidence.term import basis_over, ways_there
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_found import (
    Branches,
    CurveFound,
    counted_visits,
    means_of_visits,
)


def curve_of(drawn: FittedCurve) -> CurveFound:
    """A curve with its covariance, all else in its model refitted beside it.

    The axis of a state with a recorded reading is that reading: the scale of a level is often
    hardly known, but its reading is.
    """
    domain, count, open_ = drawn.domain, len(drawn.amounts), drawn.fitted.problem.record.open
    # The range of the driver in the final model, as far as the curve has knots there.
    final = basis_over(drawn.fitted.course(drawn.domain.driver)[open_], drawn.form.basis.length)
    low, high = max(domain.low, final.low), min(domain.high, final.high)
    at = np.linspace(low, high, limits.CURVE_POINTS)
    there = drawn.functions_at(at)
    covariance = _covariance(drawn, *drawn.rows)[-count:, -count:]
    driver, axis, shown = axis_of(drawn)
    return CurveFound(
        location=domain.location,
        driver=driver,
        at=np.interp(at, axis, shown),
        value=there @ drawn.amounts,
        covariance=there @ covariance @ there.T,
        branches=_branches(drawn),
    )


def axis_of(drawn: FittedCurve) -> tuple[str, Array, Array]:
    """The axis of a curve: its name, and values of the driver, shape (k,), with what the axis shows
    there, SI: the reading of a state, the time of the recording, or the driver itself."""
    driver, problem = drawn.domain.driver, drawn.fitted.problem
    at, order = np.unique(drawn.fitted.course(driver), return_index=True)
    if driver == TIME:
        return driver, at, at + float(problem.record.time[0])
    for name in () if driver in problem.record.inputs else problem.signals:
        shown = drawn.fitted.course(name)[order]
        if (np.diff(shown) > 0.0).all():
            return name, at, shown
    return driver, at, at


def _covariance(drawn: FittedCurve, table: Array, precision: Array) -> Array:
    """Covariance of all values, shape (values, values), with correlated errors and the prior of the
    fit; `table` and `precision` are as in `FittedCurve.rows`."""
    inverse = inverse_of(table, precision)
    judged, errors = drawn.fitted.judged, drawn.fitted.errors
    of_readings = int(judged.flags.sum())
    middle = np.diag(precision) + table[of_readings:].T @ table[of_readings:]
    first = 0
    for name, flags in judged.counted.items():
        columns = np.zeros((len(flags), table.shape[1]))
        columns[flags] = table[first : first + int(flags.sum())]
        first += int(flags.sum())
        per_variance = score_covariance(columns, errors[name], flags)
        middle += per_variance / judged.noise[name].correlation_time
    return np.asarray(inverse @ middle @ inverse)


def _branches(drawn: FittedCurve) -> Branches | None:
    """The gap between both branches, with the curve and everything else refitted beside it; None
    without a clock or with too few visits on either branch."""
    driver, problem = drawn.domain.driver, drawn.fitted.problem
    if driver == TIME or not problem.record.timed:
        return None
    course = drawn.fitted.course(drawn.domain.driver)
    given = problem.record.inputs.get(driver)
    # A simulated state has no noise.
    noise = 0.0 if given is None else white_noise(np.diff(given, 3), 3)
    side, visit = ways_there(course, noise)
    there = problem.record.open & np.isfinite(course) & (side != 0)
    if not there.any():
        return None
    counts = counted_visits(*means_of_visits(visit, there, np.ones(len(course)), course, side))
    if counts is None:
        return None
    fitted, location = drawn.fitted, drawn.domain.location
    height = float(np.ptp(drawn.form.table @ drawn.amounts))
    step = common.GENTLE * height
    inputs = ({**fitted.inputs, location.unknown: error * side} for error in (step, 0.0))
    try:
        moved, plain = (
            problem.simulate(fitted.ids, fitted.values, (), own, (location.id,)).stacked
            for own in inputs
        )
    except RanAway:
        return None
    column, (table, precision) = (moved - plain)[:, None] / step, drawn.rows
    column = fitted.fitter.as_rows(column, fitted.judged)
    whole, prior = np.column_stack([column, table]), np.concatenate([[0.0], precision])
    gradient = whole.T @ fitted.fitter.residual(fitted.at, fitted.judged)[0]
    gradient[-len(drawn.amounts) :] += drawn.amounts
    gap = -2.0 * float((inverse_of(whole, prior) @ gradient)[0])
    u = 2.0 * float(np.sqrt(_covariance(drawn, whole, prior)[0, 0]))
    return Branches(gap=gap, u=u, rising=counts[0], falling=counts[1])
