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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.output.refusal import Refusal
from scipy.linalg import block_diag

from rulec.calibration.law import Law, Near, Readings, joined, own_misfit, robust
from rulec.calibration.limits import COVERAGE, LEAST_SCATTER, MAX_CONDITION
from rulec.calibration.sheet_priors import SheetPriors
from rulec.calibration.true_flow import observer_plan, readings_of
from rulec.knowledge.plant import Module
from rulec.limits import POINTS_PER_PARAMETER, UNTOLD
from rulec.passes.differentiate import TypeModel
from rulec.passes.limits import FORM_COMMON


class CalibrationRefused(Refusal):
    """The recording cannot calibrate this plant; the message says why and what to do."""


@dataclass(frozen=True)
class CalibratedRange:
    """Ends in SI; `unvaried`: the reading varied no more than its sensor's error bound."""

    low: float
    high: float
    unvaried: bool


@dataclass(frozen=True, kw_only=True)
class ObserverFit:
    """The fit of one observer; misfit in m3/s.

    `far` are readings whose errors alone would put the points onto the law, in standard
    uncertainties that are not believed.
    """

    observer: str
    misfit: float
    r2: float
    points: int
    set_aside: int
    far: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class StateSetAside:
    """Most `points` that the fit of an observer set aside, of all `of`, lie where no point was
    kept: where the input `signal` is between `low` and `high`, SI."""

    observer: str
    signal: str
    low: float
    high: float
    points: int
    of: int


@dataclass(frozen=True, kw_only=True)
class ModuleFit:
    """Fitted parameters of a module (SI) with joint covariance, and the ranges of the readings.

    They may lie `by_form` off, as a standard uncertainty, since no law obeys its formula exactly.
    The recording determines the `untold` ones hardly better than the data sheet. `unread` are the
    observers that were not fitted, each with its readings of which there is none.
    """

    module: str
    parameters: tuple[str, ...]
    values: Array
    covariance: Array
    by_form: Array
    untold: tuple[str, ...]
    observers: tuple[ObserverFit, ...]
    valid: Mapping[str, CalibratedRange]
    states_set_aside: tuple[StateSetAside, ...]
    unread: Mapping[str, tuple[str, ...]]


def fit_module(module: Module, model: TypeModel, readings: Readings) -> ModuleFit:
    """Fit all observers of a module that have free parameters, and readings.

    Raises `CalibrationRefused` where the points cannot determine a parameter.
    """
    current = {p.name: p.value for p in module.parameters.values()}
    names: list[str] = []
    parts: list[_Part] = []
    # The parameters of the true flow itself stay as they are.
    of_references = (e for o, e in model.observers.items() if module.type.observers[o].is_reference)
    fixed = {s.name for e in of_references for s in e.free_symbols}
    flags = np.zeros(len(readings.true.values), dtype=bool)
    unread: dict[str, tuple[str, ...]] = {}
    for observer in model.observers:
        if module.type.observers[observer].is_reference:
            continue
        own = {n: readings.own.values.get(n, np.nan) for n in readings_of(model, observer)}
        if absent := tuple(n for n, v in own.items() if not np.isfinite(v).any()):
            unread[observer] = absent
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
        flags[part.rows] = True
    return ModuleFit(
        module=module.name,
        parameters=tuple(names),
        values=np.array([current[n] for n in names]),
        covariance=_joint_covariance(parts),
        by_form=np.concatenate([part.by_form for part in parts]) if parts else np.zeros(0),
        untold=tuple(name for part in parts for name in part.untold),
        observers=tuple(part.summary for part in parts),
        valid=_range(model, readings, flags),
        states_set_aside=tuple(p.state_set_aside for p in parts if p.state_set_aside),
        unread=unread,
    )


@dataclass(frozen=True, kw_only=True)
class _Part:
    """Fit of one observer: `sensitivity` is d(values)/d(flow error of each used row), `errors` are
    those of the calibrating sensors in these rows; `by_form` as in `ModuleFit`."""

    values: Array
    rows: np.ndarray
    statistical: Array
    sensitivity: Array
    by_form: Array
    errors: Sequence[Array]
    untold: tuple[str, ...]
    summary: ObserverFit
    state_set_aside: StateSetAside | None


def _fit_observer(
    module: Module,
    model: TypeModel,
    observer: str,
    free: Sequence[str],
    current: Mapping[str, float],
    readings: Readings,
) -> _Part:
    rows = _usable_rows(module, model, observer, len(free), readings)
    true = readings.true.values[rows]
    usual, varied = float(np.mean(np.abs(true))), float(np.std(true))
    size = varied if varied > LEAST_SCATTER * usual else usual
    law = Law(
        plan=observer_plan(model, observer, readings_of(model, observer)),
        inputs={**current, **readings.own.values},
        read=readings_of(model, observer),
        free=free,
        readings=readings,
        priors=SheetPriors.of([module.stated[name] for name in free]),
        size=size,
    )
    priors = law.priors
    best, bulk, own_variance = robust(law, rows)
    usual = law.points(best, bulk)[2]
    begun = law.near(best, bulk, own_variance, usual)
    _must_be_determined(module, observer, free, begun, priors.near(best)[1])
    best, _ = min(
        # A prior with long tails may have two optima; one may be the error of a bench meter.
        (
            joined(lambda at: law.near(at, bulk, own_variance, usual, begun.noise), start, priors)
            for start in (priors.begin, best)
        ),
        key=lambda way: way[1],
    )
    found = law.near(best, bulk, own_variance, law.points(best, bulk)[2], begun.noise)
    _must_have_values(module, observer, found)
    _, precision = priors.near(best)
    covariance = np.asarray(np.linalg.inv(found.precision + precision), dtype=float)
    factor = priors.spreads(best, covariance)
    sensitivity = -covariance @ found.weighing.T @ found.inward
    noisy = found.noise * covariance @ found.weighing.T @ found.inward
    statistical = noisy @ noisy.T + covariance @ precision @ covariance
    noise, forms = readings.noise(found.slopes, bulk), law.forms(best, bulk)
    # What all points have in common is fitted.
    form = float(np.sqrt((1.0 - FORM_COMMON) * np.trace(forms) / len(bulk)))
    misfit, far = own_misfit(found, best, priors, noise, form)
    true = readings.true.values[bulk]
    total = float(np.sum((true - true.mean()) ** 2))
    return _Part(
        values=priors.values(best),
        rows=bulk,
        statistical=statistical * np.outer(factor, factor),
        sensitivity=sensitivity * factor[:, None],
        by_form=np.sqrt(np.diag(sensitivity @ forms @ sensitivity.T)) * factor,
        errors=found.errors,
        untold=tuple(n for n, u in zip(free, priors.left(covariance), strict=True) if u > UNTOLD),
        summary=ObserverFit(
            observer=observer,
            misfit=misfit,
            r2=max(1.0 - float(np.sum(found.off**2)) / total, 0.0) if size == varied else 0.0,
            points=len(bulk),
            set_aside=len(rows) - len(bulk),
            far={name: far[i] for i, name in enumerate(readings.sensors) if i in far},
        ),
        state_set_aside=_state_set_aside(model, observer, readings, rows, bulk),
    )


def _state_set_aside(
    model: TypeModel, observer: str, readings: Readings, rows: np.ndarray, bulk: np.ndarray
) -> StateSetAside | None:
    """Where most of the `rows` outside the `bulk` lie beyond all of it, in one input."""
    flags = np.zeros(len(readings.true.values), dtype=bool)
    flags[bulk] = True
    aside, found = np.setdiff1d(rows, bulk), list[StateSetAside]()
    for name, bounds in _range(model, readings, flags).items():
        values = readings.own.values[name][aside]
        beyond = values[(values < bounds.low) | (values > bounds.high)]
        if model.type.signals[name].is_input and 2 * len(beyond) > len(aside):
            ends = float(beyond.min()), float(beyond.max())
            found.append(
                StateSetAside(
                    observer=observer,
                    signal=name,
                    low=ends[0],
                    high=ends[1],
                    points=len(beyond),
                    of=len(rows),
                )
            )
    return max(found, key=lambda one: one.points, default=None)


def _usable_rows(
    module: Module, model: TypeModel, observer: str, count: int, readings: Readings
) -> np.ndarray:
    """Points with all readings and a true flow; refuse if they are too few for `count`
    parameters."""
    usable = np.isfinite(readings.true.values)
    lost: dict[str, int] = {}
    for name in readings_of(model, observer):
        there = np.isfinite(readings.own.values.get(name, np.full(len(usable), np.nan)))
        lost[name] = int(np.count_nonzero(~there))
        usable &= there
    rows = np.flatnonzero(usable)
    needed = POINTS_PER_PARAMETER * max(count, 1)
    if len(rows) < needed:
        points = plural(len(rows), "settled point", "settled points")
        fitted = plural(count, "parameter", "parameters")
        worst = max(lost, key=lambda name: lost[name], default="")
        signal, why = model.type.signals.get(worst), ""
        if signal is not None and lost[worst]:
            why = f"; in {lost[worst]} of {len(usable)} {module.name}.{worst} has no usable reading"
            if signal.minimum is not None:
                least = f"{signal.unit.from_si(signal.minimum):.4g} {signal.unit.text}"
                why += f", or one below its minimum of {least}"
        raise CalibrationRefused(
            f"{module.name}.{observer}: only {points} with all readings and {readings.true.name}; "
            f"{needed} are needed for {fitted}: record more speeds or pressures{why}"
        )
    return rows


def _must_be_determined(
    module: Module, observer: str, free: Sequence[str], found: Near, precision: Array
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


def _must_have_values(module: Module, observer: str, found: Near) -> None:
    """Refuse values with which the law has no value, or no slope, at some points."""
    lost = int(np.sum(~np.isfinite(sum(found.errors, np.zeros(len(found.off))))))
    if lost:
        raise CalibrationRefused(
            f"{module.name}.{observer}: with the values that fit best the law has no value at "
            f"{lost} of {plural(len(found.off), 'settled point', 'settled points')}, such as a "
            "root of less than 0: it cannot follow this recording; look for a reading that "
            "hardly moves while the flow does, or correct the law"
        )


def _joint_covariance(parts: Sequence[_Part]) -> Array:
    """Scatter of each fit, plus errors of the calibrating sensors, shared by all fits."""
    covariance = block_diag(*(p.statistical for p in parts))
    for errors in zip(*(p.errors for p in parts), strict=True):
        shift = np.concatenate([p.sensitivity @ e for p, e in zip(parts, errors, strict=True)])
        covariance = covariance + np.outer(shift, shift)
    return np.asarray(covariance)


def _range(model: TypeModel, readings: Readings, flags: np.ndarray) -> dict[str, CalibratedRange]:
    """Ranges over which the laws were fitted, for signals of the module that they use.

    A flow meter that only serves as reference has no law with a range.
    """
    laws = [o for o in model.observers if not model.type.observers[o].is_reference]
    used = {n for o in laws for n in readings_of(model, o)}
    found = {}
    for name in model.type.signals:
        values = readings.own.values.get(name)
        if name in used and values is not None:
            inside = flags & np.isfinite(values)
            if inside.any():
                low, high = float(values[inside].min()), float(values[inside].max())
                bound = COVERAGE * float(np.max(readings.own.systematic[name][inside]))
                unvaried = not high - low > 2.0 * bound
                if unvaried:
                    middle = 0.5 * (low + high)
                    low, high = min(low, middle - bound), max(high, middle + bound)
                found[name] = CalibratedRange(low, high, unvaried)
    return found
