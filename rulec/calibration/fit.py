"""Fit the parameters of observers to a reference flow, with covariance and own misfit.

Each observer is fitted in turn for the parameters that no earlier one has. Outliers (a relief valve
opens, a valve was shut) must not distort the law: a robust fit finds the bulk, points far from it
are set aside and counted, and least squares fit the rest. The data sheet is always the prior: what
the points do not determine stays as stated.

The range over which a law was tested is that of the points, widened to the sensor's error bound. A
sensor cannot distinguish two values within its 95 % bound. If a reading varied less, the recording
holds one value of it, known to that bound; a narrower range would be left because of the sensor's
error alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.robust_statistics import spread_about
from scipy.optimize import least_squares, lsq_linear

from rulec.calibration.limits import (
    COVERAGE,
    JOINING_STEPS,
    LEAST_SCATTER,
    MAX_CONDITION,
    MISFIT_SETTLED,
    NO_VALUE,
    ROBUST_ROUNDS,
    ROBUST_WIDTH,
    SLOPE_STEP,
    SOLVED,
)
from rulec.calibration.sheet_priors import SheetPriors
from rulec.calibration.true_flow import Local, TrueFlow, observer_plan, readings_of
from rulec.knowledge.plant import Module
from rulec.limits import FAR_POINT, POINTS_PER_PARAMETER, UNTOLD
from rulec.passes.differentiate import TypeModel


class CalibrationRefused(Refusal):
    """The recording cannot calibrate this plant; the message says why and what to do."""


@dataclass(frozen=True)
class Readings:
    """Settled readings of one module, and the true flow; readings have the same names in both."""

    own: Local
    true: TrueFlow

    def errors(self, slopes: Mapping[str, Array], rows: np.ndarray) -> list[Array]:
        """How far points move off the law, m3/s, if one sensor is one standard deviation off: an
        array, shape (rows,), per sensor used by the calibration."""
        own, true = self.own.systematic, self.true.errors
        found = []
        for name in dict.fromkeys([*own, *true]):
            off: Array = np.zeros(len(rows))
            if name in slopes:
                off = off + slopes[name] * own[name][rows]
            if name in true:
                off = off - true[name][rows]
            found.append(off)
        return found


@dataclass(frozen=True)
class CalibratedRange:
    """Ends in SI; `unvaried`: the reading varied no more than its sensor's error bound."""

    low: float
    high: float
    unvaried: bool


@dataclass(frozen=True, kw_only=True)
class ObserverFit:
    """The fit of one observer; misfit in m3/s."""

    observer: str
    misfit: float
    r2: float
    points: int
    set_aside: int


@dataclass(frozen=True, kw_only=True)
class ModuleFit:
    """Fitted parameters of a module (SI) with joint covariance, and the ranges of the readings.

    The recording determines the `untold` ones hardly better than the data sheet.
    """

    module: str
    parameters: tuple[str, ...]
    values: Array
    covariance: Array
    untold: tuple[str, ...]
    observers: tuple[ObserverFit, ...]
    valid: Mapping[str, CalibratedRange]


def fit_module(module: Module, model: TypeModel, readings: Readings) -> ModuleFit:
    """Fit all observers of a module that have free parameters.

    Raises `CalibrationRefused` where the points cannot determine a parameter.
    """
    current = {p.name: p.value for p in module.parameters.values()}
    names: list[str] = []
    parts: list[_Part] = []
    # The parameters of the true flow itself stay as they are.
    of_references = (e for o, e in model.observers.items() if module.type.observers[o].is_reference)
    fixed = {s.name for e in of_references for s in e.free_symbols}
    kept_all = np.zeros(len(readings.true.values), dtype=bool)
    for observer in model.observers:
        if module.type.observers[observer].is_reference:
            continue
        used = {s.name for s in model.observers[observer].free_symbols}
        free = [
            p.name
            for p in module.parameters.values()
            if p.fit and p.name in used and p.name not in {*names, *fixed}
        ]
        part = _fit_observer(module, model, observer, free, current, readings)
        current.update(zip(free, part.values, strict=True))
        names += free
        parts.append(part)
        kept_all[part.rows] = True
    return ModuleFit(
        module=module.name,
        parameters=tuple(names),
        values=np.array([current[n] for n in names]),
        covariance=_joint_covariance(parts),
        untold=tuple(name for part in parts for name in part.untold),
        observers=tuple(part.summary for part in parts),
        valid=_range(model, readings, kept_all),
    )


@dataclass(frozen=True, kw_only=True)
class _Part:
    """Fit of one observer: `sensitivity` is d(values)/d(flow error of each used row), `errors` are
    those of the calibrating sensors in these rows."""

    values: Array
    rows: np.ndarray
    statistical: Array
    sensitivity: Array
    errors: Sequence[Array]
    untold: tuple[str, ...]
    summary: ObserverFit


def _fit_observer(
    module: Module,
    model: TypeModel,
    observer: str,
    free: Sequence[str],
    current: Mapping[str, float],
    readings: Readings,
) -> _Part:
    plan = observer_plan(model, observer, readings_of(model, observer))
    inputs: dict[str, Array | float] = {**current, **readings.own.values}
    rows = _usable_rows(module, model, observer, len(free), readings)
    known = SheetPriors.of([module.stated[name] for name in free])

    def at_values(at: Array) -> dict[str, float]:
        return dict(zip(free, known.values(at).tolist(), strict=True))

    def error(at: Array, chosen: np.ndarray) -> tuple[Array, float]:
        local = {k: v[chosen] if isinstance(v, np.ndarray) else v for k, v in inputs.items()}
        out = plan.run({**local, **at_values(at)})
        off = np.broadcast_to(out["Q"], (len(chosen),)) - readings.true.values[chosen]
        far = NO_VALUE * float(np.max(np.abs(readings.true.values[chosen])))
        slopes = {n: out[f"d:{n}"] for n in readings_of(model, observer)}
        return np.where(np.isfinite(off), off, far), _noise(slopes, chosen, readings)

    usual = float(np.mean(np.abs(readings.true.values[rows])))
    varied = float(np.std(readings.true.values[rows]))
    size = varied if varied > LEAST_SCATTER * usual else usual
    best, kept, law = _robust(error, known, rows, size)

    def near(at: Array, usual: float, noise: float | None = None) -> _Near:
        out = plan.run({**inputs, **at_values(at)})
        slopes = {n: out[f"d:{n}"][kept] for n in readings_of(model, observer)}
        return _Near.of(
            off=_even(error(at, kept), law, usual),
            jacobian=_jacobian(lambda p: _even(error(p, kept), law, usual), at, len(kept)),
            noise=noise,
            least=max(LEAST_SCATTER * size, float(np.sqrt(law + usual))),
            slopes=slopes,
            errors=readings.errors(slopes, kept),
        )

    usual = error(best, kept)[1]
    begun = near(best, usual)
    _must_be_determined(module, observer, free, begun, known.near(best)[1])
    best, _ = min(
        # A prior with long tails may have two optima; one may be the error of a bench meter.
        (_joined(lambda at: near(at, usual, begun.noise), p, known) for p in (known.begin, best)),
        key=lambda joined: joined[1],
    )
    found = near(best, error(best, kept)[1], begun.noise)
    _, precision = known.near(best)
    covariance = np.asarray(np.linalg.inv(found.precision + precision), dtype=float)
    factor = known.spreads(best, covariance)
    sensitivity = -covariance @ found.weighing.T @ found.inward
    noisy = found.noise * covariance @ found.weighing.T @ found.inward
    total = float(np.sum((readings.true.values[kept] - readings.true.values[kept].mean()) ** 2))
    summary = ObserverFit(
        observer=observer,
        misfit=_own_misfit(found, best, known, readings, kept),
        r2=max(1.0 - float(np.sum(found.off**2)) / total, 0.0) if size == varied else 0.0,
        points=len(kept),
        set_aside=len(rows) - len(kept),
    )
    return _Part(
        values=known.values(best),
        rows=kept,
        statistical=(noisy @ noisy.T + covariance @ precision @ covariance)
        * np.outer(factor, factor),
        sensitivity=sensitivity * factor[:, None],
        errors=found.errors,
        untold=tuple(n for n, u in zip(free, known.left(covariance), strict=True) if u > UNTOLD),
        summary=summary,
    )


@dataclass(frozen=True, kw_only=True)
class _Near:
    """Linear least squares near some values.

    `off`, shape (points,), are the errors, `jacobian`, shape (points, n), their slopes, which span
    `across`. After a change of the values, shape (n,), the errors are ``weighing @ change + inward
    @ off``, in standard uncertainties.
    """

    off: Array
    jacobian: Array
    noise: float
    across: Array
    weighing: Array
    inward: Array
    slopes: Mapping[str, Array]
    errors: Sequence[Array]

    @classmethod
    def of(
        cls,
        off: Array,
        jacobian: Array,
        noise: float | None,
        least: float,
        slopes: Mapping[str, Array],
        errors: Sequence[Array],
    ) -> _Near:
        """The scatter and the errors of the calibrating sensors limit how exactly each direction is
        known in which values move the points."""
        across, sizes, along = np.linalg.svd(jacobian, full_matrices=False)
        if noise is None:
            noise = max(_spread(off - across @ (across.T @ off), jacobian.shape[1]), least)
        moved = across.T @ np.column_stack([np.zeros(len(off)), *errors])
        scatter = np.linalg.cholesky(noise**2 * np.eye(len(sizes)) + moved @ moved.T)
        return cls(
            off=off,
            jacobian=jacobian,
            noise=noise,
            across=across,
            weighing=np.linalg.solve(scatter, sizes[:, None] * along),
            inward=np.linalg.solve(scatter, across.T),
            slopes=slopes,
            errors=errors,
        )

    @property
    def cost(self) -> float:
        """Sum of the squared errors of all points, in standard uncertainties."""
        within = self.off @ self.across @ self.across.T
        beyond = (self.off - within) / self.noise
        return float(np.sum(beyond**2) + np.sum((self.inward @ self.off) ** 2))

    @property
    def precision(self) -> Array:
        """Precision of the values by the recording alone, shape (n, n)."""
        return self.weighing.T @ self.weighing


def _joined(near: Callable[[Array], _Near], at: Array, known: SheetPriors) -> tuple[Array, float]:
    """Values by recording and data sheet, and their cost.

    Slopes are updated at each optimum, as an observer may be nonlinear in between.
    """
    for _ in range(JOINING_STEPS if len(at) else 0):
        found, (mean, precision) = near(at), known.near(at)
        if not np.isfinite(found.weighing).all():
            return at, float("inf")  # a step led to where the law has no value
        root = np.sqrt(np.diag(precision))
        change = lsq_linear(
            np.vstack([found.weighing, np.diag(root)]),
            np.concatenate([-(found.inward @ found.off), root * (mean - at)]),
            (known.lowest - at, known.highest - at),
        ).x
        at = at + change
        if np.allclose(change, 0.0, rtol=0.0, atol=1e-10):
            break
    return at, near(at).cost + float(np.sum(known.far(at) ** 2))


def _own_misfit(
    near: _Near, at: Array, known: SheetPriors, readings: Readings, rows: np.ndarray
) -> float:
    """Scatter, m3/s, that neither the parameters nor the errors of the calibrating sensors explain,
    nor the noise of the readings, which a diagnosis knows from its own recording.

    A bench meter that reads 5 W high moves all points alike. If the data sheet fixes the parameter
    that could follow, the points lie off the law by the meter's error, which does not say how well
    the law holds. Parameters and errors of the sensors are therefore fitted together, within their
    uncertainties.

    Source: Bayesian linear regression with conjugate priors; degrees of freedom by a trace (Hastie,
    Tibshirani, Friedman, Elements of Statistical Learning, 7.6).
    """
    slopes = np.column_stack([near.jacobian, *near.errors])
    mean, precise = known.near(at)
    precision = np.concatenate([np.diag(precise), np.ones(len(near.errors))])
    centre = np.concatenate([mean - at, np.zeros(len(near.errors))])
    squares, misfit = slopes.T @ slopes, _spread(near.off, len(at))
    for _ in range(JOINING_STEPS if misfit else 0):
        before, variance = misfit, misfit**2
        posterior = np.linalg.pinv(squares / variance + np.diag(precision), hermitian=True)
        change = posterior @ (precision * centre - slopes.T @ near.off / variance)
        freedom = len(rows) - float(np.trace(posterior @ squares)) / variance
        misfit = float(np.linalg.norm(near.off + slopes @ change) / np.sqrt(max(freedom, 1.0)))
        if np.isclose(before, misfit, rtol=MISFIT_SETTLED, atol=0.0):
            break
    return float(np.sqrt(max(misfit**2 - _noise(near.slopes, rows, readings), 0.0)))


def _noise(slopes: Mapping[str, Array], rows: np.ndarray, readings: Readings) -> float:
    """Mean variance of points about the law by the noise of readings, (m3/s)^2."""
    own, true = readings.own.statistical, readings.true.noise
    none = np.zeros(len(rows))
    variance = none
    for name in dict.fromkeys([*own, *true]):
        moved = slopes[name] * own[name][rows] if name in slopes else none
        shown = true[name][rows] if name in true else none
        variance = variance + (moved - shown) ** 2
    known = variance[np.isfinite(variance)]
    return float(np.mean(known)) if len(known) else 0.0


def _even(found: tuple[Array, float], law: float, usual: float) -> Array:
    """Errors of points, scaled from their variance by noise to the `usual` one.

    Values with which a law follows the noise of a reading explain nothing by that. `law` is the
    variance of the error of the law itself, (m3/s)^2.

    Source: Fuller, Measurement Error Models, 1987, 3.1 (errors in variables).
    """
    off, variance = found
    return off * np.sqrt((law + usual) / (law + variance)) if law + variance > 0.0 else off


def _spread(off: Array, count: int) -> float:
    return float(np.sqrt(np.sum(off**2) / max(len(off) - count, 1)))


def _usable_rows(
    module: Module, model: TypeModel, observer: str, count: int, readings: Readings
) -> np.ndarray:
    """Points with all readings and a true flow; refuse if they are too few for `count`
    parameters."""
    usable = np.isfinite(readings.true.values)
    for name in readings_of(model, observer):
        usable &= np.isfinite(readings.own.values.get(name, np.full(len(usable), np.nan)))
    rows = np.flatnonzero(usable)
    needed = POINTS_PER_PARAMETER * max(count, 1)
    if len(rows) < needed:
        points = plural(len(rows), "settled point", "settled points")
        fitted = plural(count, "parameter", "parameters")
        raise CalibrationRefused(
            f"{module.name}.{observer}: only {points} with all readings and {readings.true.name}; "
            f"{needed} are needed for {fitted}: record more speeds or pressures"
        )
    return rows


def _robust(
    error: Callable[[Array, np.ndarray], tuple[Array, float]],
    known: SheetPriors,
    rows: np.ndarray,
    size: float,
) -> tuple[Array, np.ndarray, float]:
    """Fit the bulk, set far points aside, fit again.

    The sheet weighs as much as one point, or as all of them: from a start that is hardly
    constrained, a nonlinear law may find another bulk. The likelier of the two fits counts. Also
    returns the variance of the error of the law beyond the noise of readings, (m3/s)^2.
    """
    if not len(known.begin):
        return known.begin, rows, 0.0
    ways = [_bulk(error, known, rows, size, weight) for weight in (1.0, np.sqrt(len(rows)))]
    _, best, kept, law = min(ways, key=lambda way: way[0])
    return best, kept, law


def _bulk(
    error: Callable[[Array, np.ndarray], tuple[Array, float]],
    known: SheetPriors,
    rows: np.ndarray,
    size: float,
    weight: float,
) -> tuple[float, Array, np.ndarray, float]:
    """A bulk for a weight of the sheet; returns first its negative log likelihood."""
    best, kept, scatter = known.begin, rows, ROBUST_WIDTH * size
    loss, width, law, noise = "soft_l1", ROBUST_WIDTH, scatter**2, error(best, rows)[1]
    for _ in range(ROBUST_ROUNDS):
        solution = least_squares(
            # In units of the flow's own spread: the solver's tolerances expect numbers near one.
            lambda p, chosen=kept, by=weight * scatter, law=law, noise=noise: (
                np.concatenate([_even(error(p, chosen), law, noise), by * known.far(p)]) / size
            ),
            best,
            bounds=(known.lowest, known.highest),
            loss=loss,
            f_scale=width,
            x_scale="jac",
            xtol=SOLVED,
            ftol=SOLVED,
        )
        best = solution.x
        off, noise = error(best, rows)
        centre = float(np.median(off))
        scatter = max(spread_about(off, centre), LEAST_SCATTER * size)
        kept = rows[np.abs(off - centre) <= FAR_POINT * scatter]
        loss, width, law = "linear", 1.0, max(scatter**2 - noise, 0.0)
    cost = len(rows) * float(np.log(scatter)) + 0.5 * float(np.sum(known.far(best) ** 2))
    return cost, best, kept, law


def _jacobian(error: Callable[[Array], Array], at: Array, points: int) -> Array:
    """Central differences, shape (points, n)."""
    columns = np.zeros((points, len(at)))
    for i, step in enumerate(SLOPE_STEP * np.eye(len(at))):
        columns[:, i] = (error(at + step) - error(at - step)) / (2.0 * SLOPE_STEP)
    return columns


def _must_be_determined(
    module: Module, observer: str, free: Sequence[str], found: _Near, precision: Array
) -> None:
    """Refuse parameters that neither the points nor an uncertainty of the sheet determine."""
    normal = found.precision + precision
    size = np.sqrt(np.diag(normal))
    weak = [n for n, s in zip(free, size, strict=True) if s == 0]
    condition = np.linalg.cond(normal / np.outer(size, size)) if len(free) and not weak else 1.0
    if weak or condition > MAX_CONDITION:
        unknown = [n for n in free if not module.stated[n].u]
        raise CalibrationRefused(
            f"{module.name}.{observer}: the recording does not determine "
            f"{', '.join(weak or unknown or free)}; vary the operating point more, state how "
            "exact the sheet is ('u'), or set 'fit: false'"
        )


def _joint_covariance(parts: Sequence[_Part]) -> Array:
    """Scatter of each fit, plus errors of the calibrating sensors, shared by all fits."""
    count = sum(len(p.values) for p in parts)
    covariance = np.zeros((count, count))
    place = 0
    for part in parts:
        end = place + len(part.values)
        covariance[place:end, place:end] = part.statistical
        place = end
    for errors in zip(*(p.errors for p in parts), strict=True):
        shift = np.concatenate([p.sensitivity @ e for p, e in zip(parts, errors, strict=True)])
        covariance += np.outer(shift, shift)
    return covariance


def _range(model: TypeModel, readings: Readings, kept: np.ndarray) -> dict[str, CalibratedRange]:
    """Ranges over which the laws were fitted, for signals of the module that they use.

    A flow meter that only serves as reference has no law with a range.
    """
    laws = [o for o in model.observers if not model.type.observers[o].is_reference]
    used = {n for o in laws for n in readings_of(model, o)}
    found = {}
    for name in model.type.signals:
        values = readings.own.values.get(name)
        if name in used and values is not None:
            inside = kept & np.isfinite(values)
            if inside.any():
                low, high = float(values[inside].min()), float(values[inside].max())
                bound = COVERAGE * float(np.max(readings.own.systematic[name][inside]))
                unvaried = not high - low > 2.0 * bound
                if unvaried:
                    middle = 0.5 * (low + high)
                    low, high = min(low, middle - bound), max(high, middle + bound)
                found[name] = CalibratedRange(low, high, unvaried)
    return found
