"""An observer as a law with free parameters, fitted to settled points and a data sheet.

Outliers must not distort the law: a robust fit finds the bulk, points far from it are set aside,
and least squares fit the rest. The data sheet is always the prior.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.recordings.robust_statistics import spread_about
from scipy.optimize import least_squares, lsq_linear

from rulec.calibration.limits import (
    JOINING_STEPS,
    LEAST_SCATTER,
    MISFIT_SETTLED,
    NO_VALUE,
    ROBUST_ROUNDS,
    ROBUST_WIDTH,
    SLOPE_STEP,
    SOLVED,
)
from rulec.calibration.sheet_priors import SheetPriors
from rulec.calibration.true_flow import Local, TrueFlow
from rulec.limits import FAR_POINT, UNBELIEVABLE


@dataclass(frozen=True)
class Readings:
    """Settled readings of one module, and the true flow; readings have the same names in both."""

    own: Local
    true: TrueFlow

    @property
    def sensors(self) -> tuple[str, ...]:
        """Sensors used by the calibration, in the order of `errors`."""
        return tuple(dict.fromkeys([*self.own.systematic, *self.true.errors]))

    def errors(self, slopes: Mapping[str, Array], rows: np.ndarray) -> list[Array]:
        """How far points move off the law, m3/s, if one sensor is one standard deviation off: an
        array, shape (rows,), per sensor used by the calibration."""
        return _moved(slopes, self.own.systematic, self.true.errors, rows)

    def noise(self, slopes: Mapping[str, Array], rows: np.ndarray) -> float:
        """Mean variance of points about the law by the noise of readings, (m3/s)^2."""
        moved = _moved(slopes, self.own.statistical, self.true.noise, rows)
        variance: Array = sum((part**2 for part in moved), np.zeros(len(rows)))
        finite = variance[np.isfinite(variance)]
        return float(np.mean(finite)) if len(finite) else 0.0


def _moved(
    slopes: Mapping[str, Array], own: Mapping[str, Array], true: Mapping[str, Array], rows: Array
) -> list[Array]:
    """How far each source of uncertainty moves the points `rows` off a law."""
    none = np.zeros(len(rows))
    return [
        (slopes[name] * own[name][rows] if name in slopes else none)
        - (true[name][rows] if name in true else none)
        for name in dict.fromkeys([*own, *true])
    ]


@dataclass(frozen=True, kw_only=True)
class Law:
    """An observer as a function of its `free` parameters, in the coordinates of `priors`.

    `size`, m3/s, is the spread of the true flow.
    """

    plan: Plan
    inputs: Mapping[str, Array | float]
    read: Sequence[str]
    free: Sequence[str]
    readings: Readings
    priors: SheetPriors
    size: float

    def points(self, at: Array, rows: np.ndarray) -> tuple[Array, dict[str, Array], float]:
        """Errors of points, their slopes by each reading, and their variance by noise."""
        out = self._run(at, rows)
        true = self.readings.true.values[rows]
        off = np.broadcast_to(out["Q"], (len(rows),)) - true
        slopes = {name: out[f"d:{name}"] for name in self.read}
        off = np.where(np.isfinite(off), off, NO_VALUE * float(np.max(np.abs(true))))
        return off, slopes, self.readings.noise(slopes, rows)

    def forms(self, at: Array, rows: np.ndarray) -> Array:
        """Covariance of the flow at points by the forms of laws, as their author states their
        accuracy, (m3/s)^2: Gaussian processes whose length is a third of the largest readings."""
        out = self._run(at, rows)
        flows = [np.broadcast_to(v, (len(rows),)) for n, v in out.items() if n.startswith("form:")]
        apart = np.zeros((len(rows), len(rows)))
        for name in self.read:
            x = np.asarray(self.inputs[name])[rows]
            apart += (3.0 * (x[:, None] - x) / (np.max(np.abs(x)) or 1.0)) ** 2
        changes = np.nan_to_num(np.array(flows)).reshape(-1, len(rows))
        return np.asarray(changes.T @ changes * np.exp(-0.5 * apart))

    def _run(self, at: Array, rows: np.ndarray) -> dict[str, Array]:
        local = {n: v[rows] if isinstance(v, np.ndarray) else v for n, v in self.inputs.items()}
        return self.plan.run(
            {**local, **dict(zip(self.free, self.priors.values(at).tolist(), strict=True))}
        )

    def even(self, at: Array, rows: np.ndarray, law: float, usual: float) -> Array:
        """Errors of points, scaled from their variance by noise to the `usual` one.

        Values with which a law follows the noise of a reading explain nothing by that. `law` is the
        variance of the error of the law itself, (m3/s)^2.

        Source: Fuller, Measurement Error Models, 1987, 3.1 (errors in variables).
        """
        off, _, variance = self.points(at, rows)
        return off * np.sqrt((law + usual) / (law + variance)) if law + variance > 0.0 else off

    def near(
        self, at: Array, rows: np.ndarray, law: float, usual: float, noise: float | None = None
    ) -> Near:
        """Linear least squares near a point; without a `noise`, that of the points.

        The scatter and the errors of the calibrating sensors limit how exactly each direction is
        known in which values move the points.
        """
        off, slopes = self.even(at, rows, law, usual), self.points(at, rows)[1]
        errors = self.readings.errors(slopes, rows)
        jacobian = np.zeros((len(rows), len(at)))
        for i, step in enumerate(SLOPE_STEP * np.eye(len(at))):
            ahead, behind = (self.even(p, rows, law, usual) for p in (at + step, at - step))
            jacobian[:, i] = (ahead - behind) / (2.0 * SLOPE_STEP)
        across, sizes, along = np.linalg.svd(jacobian, full_matrices=False)
        if noise is None:
            least = max(LEAST_SCATTER * self.size, float(np.sqrt(law + usual)))
            noise = max(_spread(off - across @ (across.T @ off), len(at)), least)
        moved = across.T @ np.column_stack([np.zeros(len(off)), *errors])
        scatter = np.linalg.cholesky(noise**2 * np.eye(len(sizes)) + moved @ moved.T)
        return Near(
            off=off,
            jacobian=jacobian,
            noise=noise,
            across=across,
            weighing=np.linalg.solve(scatter, sizes[:, None] * along),
            inward=np.linalg.solve(scatter, across.T),
            slopes=slopes,
            errors=errors,
        )


@dataclass(frozen=True, kw_only=True)
class Near:
    """Linear least squares near some values.

    `off`, shape (points,), are the errors, `jacobian`, shape (points, n), their slopes, which span
    `across`. After a change of the values, shape (n,), the errors are ``weighing @ change + inward
    @ off``, in standard uncertainties. `slopes` are those by each reading, `errors` what each
    calibrating sensor adds.
    """

    off: Array
    jacobian: Array
    noise: float
    across: Array
    weighing: Array
    inward: Array
    slopes: Mapping[str, Array]
    errors: Sequence[Array]

    @property
    def cost(self) -> float:
        """Sum of the squared errors of all points, in standard uncertainties."""
        followed = self.off @ self.across @ self.across.T
        beyond = (self.off - followed) / self.noise
        return float(np.sum(beyond**2) + np.sum((self.inward @ self.off) ** 2))

    @property
    def precision(self) -> Array:
        """Precision of the values by the recording alone, shape (n, n)."""
        return self.weighing.T @ self.weighing


def joined(near: Callable[[Array], Near], at: Array, priors: SheetPriors) -> tuple[Array, float]:
    """Values by recording and data sheet, and their cost.

    Slopes are updated at each optimum, as an observer may be nonlinear in between.
    """
    for _ in range(JOINING_STEPS if len(at) else 0):
        found, (mean, precision) = near(at), priors.near(at)
        if not np.isfinite(found.weighing).all():
            return at, float("inf")  # a step led to where the law has no value
        root = np.sqrt(np.diag(precision))
        change = lsq_linear(
            np.vstack([found.weighing, np.diag(root)]),
            np.concatenate([-(found.inward @ found.off), root * (mean - at)]),
            (priors.lowest - at, priors.highest - at),
        ).x
        at = at + change
        if np.allclose(change, 0.0, rtol=0.0, atol=1e-10):
            break
    return at, near(at).cost + float(np.sum(priors.far(at) ** 2))


def own_misfit(
    near: Near, at: Array, priors: SheetPriors, noise: float, form: float
) -> tuple[float, Mapping[int, float]]:
    """Scatter, m3/s, that neither the parameters nor the errors of the calibrating sensors explain,
    nor the `noise` of the readings, (m3/s)^2, which a diagnosis knows from its own recording.

    A bench meter that reads 5 W high moves all points alike. If the data sheet fixes the parameter
    that could follow, the points lie off the law by the meter's error, which does not say how well
    the law holds. Parameters and errors of the sensors are therefore fitted together, within their
    uncertainties. If a sensor would then have an error that is not believed, it explains nothing:
    the scatter is that about the law as it is.

    The scatter of few points may be small by chance: the `form`, m3/s, which the stated accuracy of
    the laws lets expect within a factor of two, counts as one point more. Also returns errors that
    are not believed, in standard uncertainties, by the place of the sensor in `near.errors`.

    Source: Bayesian linear regression with conjugate priors; degrees of freedom by a trace (Hastie,
    Tibshirani, Friedman, Elements of Statistical Learning, 7.6).
    """
    slopes = np.column_stack([near.jacobian, *near.errors])
    mean, precise = priors.near(at)
    precision = np.concatenate([np.diag(precise), np.ones(len(near.errors))])
    centre = np.concatenate([mean - at, np.zeros(len(near.errors))])
    squares, misfit = slopes.T @ slopes, _spread(near.off, len(at))
    freedom = float(max(len(near.off) - len(at), 0))
    whole, change = misfit, np.zeros(slopes.shape[1])
    for _ in range(JOINING_STEPS if misfit else 0):
        before, variance = misfit, misfit**2
        posterior = np.linalg.pinv(squares / variance + np.diag(precision), hermitian=True)
        change = posterior @ (precision * centre - slopes.T @ near.off / variance)
        freedom = len(near.off) - float(np.trace(posterior @ squares)) / variance
        misfit = float(np.linalg.norm(near.off + slopes @ change) / np.sqrt(max(freedom, 1.0)))
        if np.isclose(before, misfit, rtol=MISFIT_SETTLED, atol=0.0):
            break
    far = {i: z for i, z in enumerate(change[len(at) :].tolist()) if abs(z) > UNBELIEVABLE}
    own = max((whole if far else misfit) ** 2 - noise, 0.0)
    # Conjugate priors of a variance; and what is expected of another point (Student).
    expected = (form**2 + freedom * own) / (1.0 + freedom)
    return float(np.sqrt(expected * (1.0 + freedom) / max(freedom - 1.0, 1.0))), far


def _spread(off: Array, count: int) -> float:
    return float(np.sqrt(np.sum(off**2) / max(len(off) - count, 1)))


def robust(law: Law, rows: np.ndarray) -> tuple[Array, np.ndarray, float]:
    """Fit the bulk, set far points aside, fit again.

    The sheet weighs as much as one point, or as all of them: from a start that is hardly
    constrained, a nonlinear law may find another bulk. The likelier of the two fits counts. Also
    returns the variance of the error of the law beyond the noise of readings, (m3/s)^2.
    """
    priors, size = law.priors, law.size
    if not len(priors.begin):
        return priors.begin, rows, 0.0
    ways = []
    for weight in (1.0, np.sqrt(len(rows))):
        best, bulk, scatter = priors.begin, rows, ROBUST_WIDTH * size
        loss, width, own, noise = "soft_l1", ROBUST_WIDTH, scatter**2, law.points(best, rows)[2]
        for _ in range(ROBUST_ROUNDS):
            best = least_squares(
                # In units of the flow's own spread: the solver's tolerances expect numbers near 1.
                lambda p, chosen=bulk, by=weight * scatter, own=own, noise=noise: (
                    np.concatenate([law.even(p, chosen, own, noise), by * priors.far(p)]) / size
                ),
                best,
                bounds=(priors.lowest, priors.highest),
                loss=loss,
                f_scale=width,
                x_scale="jac",
                xtol=SOLVED,
                ftol=SOLVED,
            ).x
            off, _, noise = law.points(best, rows)
            centre = float(np.median(off))
            scatter = max(spread_about(off, centre), LEAST_SCATTER * size)
            bulk = rows[np.abs(off - centre) <= FAR_POINT * scatter]
            loss, width, own = "linear", 1.0, max(scatter**2 - noise, 0.0)
        unlikely = len(rows) * float(np.log(scatter)) + 0.5 * float(np.sum(priors.far(best) ** 2))
        ways.append((unlikely, best, bulk, own))
    return min(ways, key=lambda way: way[0])[1:]
