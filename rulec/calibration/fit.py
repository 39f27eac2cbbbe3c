"""Fit the parameters of observers to a reference flow, with covariance and own misfit.

Each observer is fitted in turn for the parameters that no earlier one has. Outliers (a relief valve
opens, a valve was shut) must not distort the law: a robust fit finds the bulk, points far from it
are set aside and counted, the rest is fitted by least squares. The result is combined with the data
sheet's values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.robust import spread_about
from scipy.optimize import least_squares

from rulec.calibration.calibrated_range import CalibratedRange, range_of
from rulec.calibration.true_flow import Local, TrueFlow, observer_plan, readings_of
from rulec.knowledge.data_sheet import Sheet
from rulec.knowledge.plant import Module
from rulec.limits import (
    FAR_POINT,
    JOINING_STEPS,
    LEAST_SCATTER,
    MAX_CONDITION,
    MISFIT_SETTLED,
    NO_VALUE,
    POINTS_PER_PARAMETER,
    ROBUST_ROUNDS,
    ROBUST_WIDTH,
    SLOPE_STEP,
    SOLVED,
)
from rulec.passes.differentiate import TypeModel


class CalibrationRefused(Refusal):
    """The recording cannot calibrate this plant; the message says why and what to do."""


@dataclass(frozen=True)
class Readings:
    """Settled readings of one module, and the true flow.

    A reading that both rest on has the same name in both.
    """

    own: Local
    true: TrueFlow


@dataclass(frozen=True, kw_only=True)
class ObserverFit:
    """What was found for one observer; misfit in m3/s.

    `contradicts`: recording and data sheet contradict each other.
    """

    observer: str
    misfit: float
    r2: float
    points: int
    set_aside: int
    contradicts: bool


@dataclass(frozen=True, kw_only=True)
class ModuleFit:
    """Fitted parameters of a module (SI) with joint covariance, and the range of the readings."""

    module: str
    parameters: tuple[str, ...]
    values: Array
    covariance: Array
    observers: tuple[ObserverFit, ...]
    valid: Mapping[str, CalibratedRange]


def fit_module(module: Module, model: TypeModel, readings: Readings) -> ModuleFit:
    """Fit all observers of a module that have free parameters.

    Raises `CalibrationRefused` where the points cannot determine a parameter.
    """
    current = {p.name: p.value for p in module.parameters.values()}
    names: list[str] = []
    parts: list[_Part] = []
    held = _held(module, model)
    kept_all = np.zeros(len(readings.true.values), dtype=bool)
    for observer in model.observers:
        if module.type.observers[observer].is_reference:
            continue
        used = {s.name for s in model.observers[observer].free_symbols}
        free = [
            p.name
            for p in module.parameters.values()
            if p.fit and p.name in used and p.name not in {*names, *held}
        ]
        part = _fit_observer(module, model, observer, free, current, readings)
        current.update(zip(free, part.values, strict=True))
        names += free
        parts.append(part)
        kept_all[part.rows] = True
    values = np.array([current[n] for n in names])
    return ModuleFit(
        module=module.name,
        parameters=tuple(names),
        values=values,
        covariance=_joint_covariance(parts, readings),
        observers=tuple(part.summary for part in parts),
        valid=_range(model, readings, kept_all),
    )


def _held(module: Module, model: TypeModel) -> set[str]:
    """What the true flow itself rests on stays as it is."""
    of_references = (e for o, e in model.observers.items() if module.type.observers[o].is_reference)
    return {s.name for e in of_references for s in e.free_symbols}


@dataclass(frozen=True, kw_only=True)
class _Part:
    """Fit of one observer: `sensitivity` is d(values)/d(flow error of each used row)."""

    values: Array
    rows: np.ndarray
    statistical: Array
    sensitivity: Array
    slopes: Mapping[str, Array]
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
    scale = np.array([_scale(module, n) for n in free])
    begin = np.array([current[n] for n in free]) / scale

    def error(scaled: Array, chosen: np.ndarray) -> Array:
        fixed = dict(zip(free, (scaled * scale).tolist(), strict=True))
        local = {k: v[chosen] if isinstance(v, np.ndarray) else v for k, v in inputs.items()}
        flows = np.broadcast_to(plan.run({**local, **fixed})["Q"], (len(chosen),))
        off = flows - readings.true.values[chosen]
        far = NO_VALUE * float(np.max(np.abs(readings.true.values[chosen])))
        bounded: Array = np.where(np.isfinite(off), off, far)
        return bounded

    size = float(np.std(readings.true.values[rows])) or float(
        np.mean(np.abs(readings.true.values[rows]))
    )
    best, kept = _robust(error, begin, rows, size)

    def near(at: Array) -> _Near:
        """The fit by the recording alone, as slopes at these values say it."""
        off = error(at, kept)
        jacobian = (
            _jacobian(lambda p: error(p, kept), at, size) if free else np.zeros((len(off), 0))
        )
        inverse = _inverse(module, observer, free, jacobian)
        local = {**inputs, **dict(zip(free, at * scale, strict=True))}
        slopes = _input_slopes(plan, model, observer, local)
        return _Near(
            off=off,
            jacobian=jacobian,
            best=at - inverse @ jacobian.T @ off,
            inverse=inverse,
            sensitivity=-(inverse @ jacobian.T),
            slopes={name: slope[kept] for name, slope in slopes.items()},
        )

    alone = near(best)
    noise = _spread(alone.off, len(free))
    stated = Sheet.of([module.stated[name] for name in free]).scaled(scale)
    sheet = stated.beside(best, alone.covariance(noise, kept, readings))
    best, joined, weight = _joined(
        near, best, sheet, lambda found: found.covariance(noise, kept, readings)
    )
    statistical = noise**2 * weight @ joined.inverse @ weight.T + sheet.share(weight)
    total = float(np.sum((readings.true.values[kept] - readings.true.values[kept].mean()) ** 2))
    summary = ObserverFit(
        observer=observer,
        misfit=_own_misfit(joined, best, sheet, readings, kept),
        r2=1.0 - float(np.sum(joined.off**2)) / total if total else 0.0,
        points=len(kept),
        set_aside=len(rows) - len(kept),
        contradicts=sheet.is_empty and not stated.is_empty,
    )
    return _Part(
        values=best * scale,
        rows=kept,
        statistical=statistical * np.outer(scale, scale),
        sensitivity=(weight @ joined.sensitivity) * scale[:, None],
        slopes=joined.slopes,
        summary=summary,
    )


@dataclass(frozen=True, kw_only=True)
class _Near:
    """Least squares near some values, scaled: where they lead, and how they came about.

    `off` shape (points,), with slopes `jacobian` (points, n); `best` shape (n,); `sensitivity` is
    d(best)/d(flow error), (n, points).
    """

    off: Array
    jacobian: Array
    best: Array
    inverse: Array
    sensitivity: Array
    slopes: Mapping[str, Array]

    def covariance(self, noise: float, rows: np.ndarray, readings: Readings) -> Array:
        """Scatter, and what the errors of the calibrating sensors do."""
        covariance = noise**2 * self.inverse
        for name in _calibrating(readings):
            shift = _shift(self.sensitivity, self.slopes, rows, name, readings)
            covariance = covariance + np.outer(shift, shift)
        return covariance


def _joined(
    near: Callable[[Array], _Near],
    at: Array,
    sheet: Sheet,
    covariance: Callable[[_Near], Array],
) -> tuple[Array, _Near, Array]:
    """Values by recording and data sheet, the fit near them, and the weight of the recording.

    Slopes are taken anew where the two meet, as an observer may bend between them.
    """
    for _ in range(JOINING_STEPS if len(at) else 0):
        alone = near(at)
        before, at = at, sheet.joined(alone.best, sheet.weight(covariance(alone)))
        if np.allclose(before, at, rtol=1e-10, atol=1e-12):
            break
    found = near(at)
    return at, found, sheet.weight(covariance(found)) if len(at) else np.zeros((0, 0))


def _own_misfit(
    near: _Near, at: Array, sheet: Sheet, readings: Readings, rows: np.ndarray
) -> float:
    """Scatter, m3/s, that neither the parameters nor the calibrating sensors' errors explain, nor
    the noise of the readings, which a diagnosis knows of its own recording.

    A bench meter that reads 5 W high moves all points alike. Where the data sheet holds the
    parameter that could follow, the points lie beside the law by the meter's error; it says
    nothing of how well the law holds. Parameters and errors of the sensors are therefore fitted
    together, within their uncertainties.

    Source: Bayesian linear regression with conjugate priors; freedom is the trace of what is left
    free (Hastie, Tibshirani, Friedman, Elements of Statistical Learning, 7.6).
    """
    errors = [_error(near.slopes, rows, name, readings) for name in _calibrating(readings)]
    slopes = np.column_stack([near.jacobian, *errors])
    precision = np.concatenate([sheet.precision, np.ones(len(errors))])
    centre = np.concatenate([sheet.values - at, np.zeros(len(errors))])
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
    """Mean variance by which points scatter about the law for the noise of readings, (m3/s)^2."""
    own, true = readings.own.statistical, readings.true.noise
    none = np.zeros(len(rows))
    variance = none
    for name in dict.fromkeys([*own, *true]):
        moved = slopes[name] * own[name][rows] if name in slopes else none
        shown = true[name][rows] if name in true else none
        variance = variance + (moved - shown) ** 2
    return float(np.mean(variance))


def _spread(off: Array, count: int) -> float:
    return float(np.sqrt(np.sum(off**2) / max(len(off) - count, 1)))


def _usable_rows(
    module: Module, model: TypeModel, observer: str, count: int, readings: Readings
) -> np.ndarray:
    """Points with all readings and a true flow; refuses if they are too few for `count`."""
    usable = np.isfinite(readings.true.values)
    for name in readings_of(model, observer):
        usable &= np.isfinite(readings.own.values.get(name, np.full(len(usable), np.nan)))
    rows = np.flatnonzero(usable)
    needed = POINTS_PER_PARAMETER * max(count, 1)
    if len(rows) < needed:
        raise CalibrationRefused(
            f"{module.name}.{observer}: only {len(rows)} settled points with all readings and "
            f"{readings.true.name}; {needed} are needed for {count} parameters"
        )
    return rows


def _input_slopes(
    plan: Plan, model: TypeModel, observer: str, inputs: Mapping[str, Array | float]
) -> dict[str, Array]:
    out = plan.run(inputs)
    return {n: out[f"d:{n}"] for n in readings_of(model, observer)}


def _scale(module: Module, name: str) -> float:
    """Size of a parameter, so that the fit works on numbers near one."""
    parameter = module.parameters[name]
    return max(abs(parameter.value), parameter.u) or parameter.unit.factor


def _robust(
    error: Callable[[Array, np.ndarray], Array], begin: Array, rows: np.ndarray, size: float
) -> tuple[Array, np.ndarray]:
    """Fit the bulk, set far points aside, fit again."""
    if not len(begin):
        return begin, rows
    kept, best = rows, begin
    loss, width = "soft_l1", ROBUST_WIDTH
    for _ in range(ROBUST_ROUNDS):
        solution = least_squares(
            # In units of the flow's own spread: the solver's tolerances expect numbers near one.
            lambda p, chosen=kept: error(p, chosen) / size,
            best,
            loss=loss,
            f_scale=width,
            x_scale="jac",
            xtol=SOLVED,
            ftol=SOLVED,
        )
        best = solution.x
        off = error(best, rows)
        centre = float(np.median(off))
        spread = spread_about(off, centre)
        kept = rows[np.abs(off - centre) <= FAR_POINT * max(spread, LEAST_SCATTER * size)]
        loss, width = "linear", 1.0
    return best, kept


def _jacobian(error: Callable[[Array], Array], at: Array, size: float) -> Array:
    """Central differences in scaled parameters."""
    columns = []
    for i in range(len(at)):
        step = np.zeros_like(at)
        step[i] = SLOPE_STEP * max(abs(at[i]), 1e-3)
        columns.append((error(at + step) - error(at - step)) / (2.0 * step[i]))
    return np.stack(columns, axis=1)


def _inverse(module: Module, observer: str, free: Sequence[str], jacobian: Array) -> Array:
    """Inverse of the normal matrix; refuses parameters that the points do not determine."""
    if not len(free):
        return np.zeros((0, 0))
    normal = jacobian.T @ jacobian
    size = np.sqrt(np.diag(normal))
    weak = [n for n, s in zip(free, size, strict=True) if s == 0]
    condition = np.linalg.cond(normal / np.outer(size, size)) if not weak else np.inf
    if not np.isfinite(condition) or condition > MAX_CONDITION:
        raise CalibrationRefused(
            f"{module.name}.{observer}: the recording does not determine "
            f"{', '.join(weak or free)} apart; vary the operating point more, or set 'fit: false'"
        )
    inverse: Array = np.linalg.inv(normal / np.outer(size, size)) / np.outer(size, size)
    return inverse


def _joint_covariance(parts: Sequence[_Part], readings: Readings) -> Array:
    """Scatter of each fit, plus errors of the calibrating sensors, shared by all fits."""
    count = sum(len(p.values) for p in parts)
    covariance = np.zeros((count, count))
    place = 0
    for part in parts:
        end = place + len(part.values)
        covariance[place:end, place:end] = part.statistical
        place = end
    for name in _calibrating(readings):
        shift = np.concatenate(
            [_shift(p.sensitivity, p.slopes, p.rows, name, readings) for p in parts]
        )
        covariance += np.outer(shift, shift)
    return covariance


def _calibrating(readings: Readings) -> list[str]:
    """Names of all sensors that a calibration rests on."""
    return list(dict.fromkeys([*readings.own.systematic, *readings.true.errors]))


def _shift(
    sensitivity: Array,
    slopes: Mapping[str, Array],
    rows: np.ndarray,
    name: str,
    readings: Readings,
) -> Array:
    """Change of the parameters if one sensor is one standard deviation off all the time."""
    shift: Array = sensitivity @ _error(slopes, rows, name, readings)
    return shift


def _error(slopes: Mapping[str, Array], rows: np.ndarray, name: str, readings: Readings) -> Array:
    """How far points move off the law, m3/s, if one sensor is one standard deviation off."""
    off: Array = np.zeros(len(rows))
    if name in slopes:
        off = off + slopes[name] * readings.own.systematic[name][rows]
    if name in readings.true.errors:
        off = off - readings.true.errors[name][rows]
    return off


def _range(model: TypeModel, readings: Readings, kept: np.ndarray) -> dict[str, CalibratedRange]:
    """Readings over which the laws were fitted, for own signals that they use.

    A flow meter that only serves as reference has no law that could be left.
    """
    laws = [o for o in model.observers if not model.type.observers[o].is_reference]
    used = {n for o in laws for n in readings_of(model, o)}
    found = {}
    for name in model.type.signals:
        values = readings.own.values.get(name)
        if name in used and values is not None:
            inside = kept & np.isfinite(values)
            if inside.any():
                found[name] = range_of(values[inside], readings.own.systematic[name][inside])
    return found
