"""Evaluate a ruleset on readings: flow estimates, residuals, and which of them are unusable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import MISFIT, Ruleset, SignalSpec
from rulec_runtime.diagnosis.steady.batches import FIRST, SECOND, THIRD, points_along
from rulec_runtime.diagnosis.steady.independent_parts import Part
from rulec_runtime.diagnosis.steady.points import Points

NOT_RECORDED = " not recorded"
"""Follows the name of a reading that the recording does not have."""


@dataclass(frozen=True, kw_only=True)
class Observed:
    """Results of the plan at points.

    Attributes
    ----------
    flows : shape (observers, n), m3/s.
    valid : shape (observers, n).
    noise : shape (n, observers, observers), covariance of errors new at every point: the noise of
        readings and the observers' own misfit; (m3/s)^2.
    scatter : as `noise`, of the noise of readings alone.
    shared : shape (observers, errors, n): derivative by each error that lasts over a recording
        (systematic errors of sensors, their lags, the calibration) times its standard uncertainty,
        m3/s.
    errors : names of these errors; that of a lag is ``lag:<signal>``.
    offsets : shape (observers, n), the baseline's correction to subtract from each flow, m3/s.
    covariance : shape (n, observers, observers), of flows less offsets, (m3/s)^2.
    drift : as `noise`, the part of it from `drift_of`.
    residuals, residual_u : shape (residuals, n), m3/s.
    residual_systematic : shape (residuals, n), the part of residual_u that does not average out:
        sensors' systematic errors and the calibration.
    extrapolated : shape (signals out of range, n) as table signal -> flags.
    vague : shape (observers, n), standard uncertainties of flows by parameters alone, m3/s.
    u : shape (observers, n), standard uncertainties of flows less offsets, m3/s, once covariances
        of all points would be too large: `scatter` and `covariance` are empty then.
    """

    points: Points
    flows: Array = field(metadata=SECOND)
    valid: np.ndarray = field(metadata=SECOND)
    noise: Array = field(metadata=FIRST)
    scatter: Array = field(metadata=FIRST)
    shared: Array = field(metadata=THIRD)
    errors: tuple[str, ...]
    offsets: Array = field(metadata=SECOND)
    covariance: Array = field(metadata=FIRST)
    drift: Array = field(metadata=FIRST)
    residuals: Array = field(metadata=SECOND)
    residual_u: Array = field(metadata=SECOND)
    residual_systematic: Array = field(metadata=SECOND)
    vague: Array = field(metadata=SECOND)
    extrapolated: Mapping[str, np.ndarray]
    u: Array | None = field(default=None, metadata=SECOND)

    def __len__(self) -> int:
        return int(self.flows.shape[1])

    def covariance_at(self, points: np.ndarray) -> Array:
        """Covariance of flows at some points, shape (points, observers, observers), without the
        shift by a baseline."""
        shared = np.ascontiguousarray(np.moveaxis(self.shared[:, :, points], -1, 0))
        return np.asarray(self.noise[points] + shared @ shared.transpose(0, 2, 1))

    def cache(self) -> Observed:
        """What is kept of some points: of the tables of all covariances only what stacks need."""
        nothing = np.zeros((len(self), 0, 0))
        u = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)).T
        return replace(self, scatter=nothing, covariance=nothing, u=u)


POINTS_ALONG = points_along(Observed)


def plan_inputs(points: Points, u: Mapping[str, Array] | None = None) -> dict[str, Array | float]:
    """Inputs of the plan: readings, their uncertainties (by default with lags), and all of the
    calibration."""
    inputs: dict[str, Array | float] = {**points.values}
    of_readings = points.u_with_lag if u is None else u
    inputs.update({f"u:{name}": part for name, part in of_readings.items()})
    inputs["u:parameters"] = 1.0
    inputs["u:model"] = 1.0
    return inputs


def observe(ruleset: Ruleset, points: Points) -> Observed:
    """Run the plan on points and decide which estimates are usable."""
    names = [n for n in ruleset.plan.outputs if n.split(":", 1)[0] in ("q", "guard")]
    n = len(points)
    results = ruleset.plan.select(names).run(points.values)
    out = {name: np.broadcast_to(v, (n,)) for name, v in results.items()}
    observers = ruleset.observers
    flows = np.array([out[f"q:{o.id}"] for o in observers])
    valid = np.isfinite(flows)
    # Readings reach their minimum, guards and the flow are positive.
    with np.errstate(invalid="ignore"):
        for usable, flow, observer in zip(valid, flows, observers, strict=True):
            usable &= flow > 0
            for guard in observer.guards:
                usable &= out[guard.output] > 0
            for signal in observer.signals:
                minimum = ruleset.signal_by_id[signal].minimum
                if minimum is not None and signal in points.values:
                    usable &= points.values[signal] >= minimum
    units = dict.fromkeys(points.values, np.ones(n))
    slopes = ruleset.plan.select(slope_names(ruleset)).run(plan_inputs(points, units))
    observed = with_errors(ruleset, points, flows, valid, slopes)
    return replace(observed, extrapolated=extrapolated(ruleset, points))


def observe_part(whole: Ruleset, part: Part, points: Points) -> Observed:
    """Results of the plan of a part; `extrapolated` covers readings of the whole plant."""
    if part.ruleset is whole:
        return observe(whole, points)
    observed = observe(part.ruleset, points.of(part.ruleset.observed))
    return replace(observed, extrapolated=extrapolated(whole, points))


def slope_names(ruleset: Ruleset) -> tuple[str, ...]:
    """Outputs of the plan that are slopes of estimates: ``s:<observer>:<error>``."""
    return tuple(name for name in ruleset.plan.outputs if name.startswith("s:"))


def with_errors(
    ruleset: Ruleset,
    points: Points,
    flows: Array,
    valid: np.ndarray,
    slopes: Mapping[str, Array],
) -> Observed:
    """Estimates with their errors, and no reading marked as extrapolated.

    Parameters
    ----------
    flows, valid : shape (observers, n), m3/s.
    slopes : per name of `slope_names` an array, shape (n,): derivatives by readings, m3/s per SI,
        and by other errors times their standard uncertainty, m3/s.
    """
    scatter, noise, lasting, errors, shared, late, vague = _errors_of(
        ruleset, points, slopes, flows.shape
    )
    with np.errstate(invalid="ignore"):
        valid = valid & (late <= limits.TOO_FAST * np.abs(flows))
    covariance = noise + lasting
    return Observed(
        points=points,
        flows=flows,
        valid=valid,
        noise=noise,
        scatter=scatter,
        shared=shared,
        errors=errors,
        offsets=np.zeros_like(flows),
        covariance=covariance,
        drift=np.zeros_like(noise),
        residuals=signed(ruleset, flows),
        residual_u=spreads(ruleset, covariance),
        residual_systematic=spreads(ruleset, covariance - scatter),
        vague=vague,
        extrapolated={},
    )


Gradients = dict[str, dict[int, Array]]
"""Per error the observers (rows) it reaches: derivative times standard uncertainty, m3/s,
(n,)."""


def trusted(ruleset: Ruleset, observed: Observed) -> Observed:
    """Estimates, usable only where their parameters are known well enough to judge by them."""
    certain = ~too_vague(ruleset, observed, slice(None))
    return replace(observed, valid=observed.valid & certain)


def too_vague(ruleset: Ruleset, observed: Observed, points: slice) -> np.ndarray:
    """Positive estimates whose parameters are not known well enough to judge by them, relative to
    the flow or, where that is larger, to that at the reference point; shape (observers, points)."""
    flows, vague = observed.flows[:, points], observed.vague[:, points]
    reference = np.array([[abs(o.reference)] for o in ruleset.observers])
    return np.asarray((flows > 0) & ~(vague <= limits.TOO_VAGUE * np.maximum(flows, reference)))


def _errors_of(
    ruleset: Ruleset, points: Points, slopes: Mapping[str, Array], shape: tuple[int, int]
) -> tuple[Array, Array, Array, tuple[str, ...], Array, Array, Array]:
    """Covariances, shape (n, observers, observers), of the noise of readings, of everything new at
    every point and of what lasts over a recording, names of the latter and gradients by them, shape
    (observers, errors, n), and standard uncertainties by lags and by parameters alone, of the
    `shape` (observers, n)."""
    row = ruleset.observer_index
    scatter: Gradients = {}
    misfits: Gradients = {}
    lasting: Gradients = {}
    late, vague = np.zeros((2, *shape))
    # A reading beyond all limits has no slope; its estimate is unusable.
    with np.errstate(invalid="ignore", over="ignore"):
        for name in slopes:
            _, observer, error = name.split(":", 2)
            if error.endswith(MISFIT):
                misfits.setdefault(error, {})[row[observer]] = slopes[name]
                lasting.setdefault(error, {})
                continue
            systematic: Array | float = 1.0
            if error not in ruleset.signal_by_id:
                vague[row[observer]] += slopes[name] ** 2
            if error in points.u:
                systematic = points.systematic[error]
                own = slopes[name] * points.statistical(error)
                scatter.setdefault(error, {})[row[observer]] = own
            if error in points.lag:
                own = slopes[name] * points.lag[error]
                lasting.setdefault(f"lag:{error}", {})[row[observer]] = own
                late[row[observer]] += own**2
            lasting.setdefault(error, {})[row[observer]] = slopes[name] * systematic
        read = _covariance(scatter, shape)
        new = read + _covariance(misfits, shape)
        spread = np.sqrt(late), np.sqrt(vague)
        names, table = tuple(sorted(lasting)), _stacked(lasting, shape)
        return read, new, _covariance(lasting, shape), names, table, *spread


def _covariance(gradients: Gradients, shape: tuple[int, int]) -> Array:
    """Sum of the products of gradients by the same error, shape (n, observers, observers).

    An error reaches few observers. Points are last in memory, so that sums run over them.
    """
    observers, n = shape
    covariance = np.zeros((observers, observers, n))
    for column in gradients.values():
        rows = np.array([*column], dtype=int)
        table = np.array([*column.values()]).reshape(-1, n)
        # Far outside of its law an estimate has an infinite variance.
        with np.errstate(over="ignore"):
            for i, own in zip(rows, table, strict=True):
                covariance[i, rows] += own * table
    return np.moveaxis(covariance, -1, 0)


def _stacked(gradients: Gradients, shape: tuple[int, int]) -> Array:
    """Gradients by all errors as one table, shape (observers, errors, n)."""
    observers, n = shape
    table = np.zeros((observers, len(gradients), n))
    for row, error in enumerate(sorted(gradients)):
        for i, gradient in gradients[error].items():
            table[i, row] = gradient
    return table


def signed(ruleset: Ruleset, flows: Array) -> Array:
    """Residuals of flows, m3/s, shape (residuals, n)."""
    row = ruleset.observer_index
    sums = [sum(t.sign * flows[row[t.observer]] for t in r.terms) for r in ruleset.residuals]
    return np.array(sums).reshape(-1, flows.shape[1])


def spreads(ruleset: Ruleset, covariance: Array) -> Array:
    """Standard uncertainties of the residuals, m3/s, shape (residuals, n)."""
    row = ruleset.observer_index
    points_last = np.moveaxis(covariance, 0, -1)
    result = np.zeros((len(ruleset.residuals), len(covariance)))
    for i, residual in enumerate(ruleset.residuals):
        rows = [row[t.observer] for t in residual.terms]
        signs = np.array([float(t.sign) for t in residual.terms])
        own = points_last[np.ix_(rows, rows)]
        variance = np.einsum("i,ijn,j->n", signs, own, signs)
        result[i] = np.sqrt(np.maximum(variance, 0.0))
    return result


def flows_at(ruleset: Ruleset, readings: Mapping[str, Array]) -> Array:
    """Estimate of each observer, m3/s, shape (observers, n), usable or not."""
    names = [f"q:{o.id}" for o in ruleset.observers]
    n = max(map(len, readings.values()), default=0)
    results = ruleset.plan.select(names).run(readings)
    return np.array([np.broadcast_to(results[name], (n,)) for name in names])


def extrapolated(ruleset: Ruleset, points: Points) -> dict[str, np.ndarray]:
    """Signals outside the range in which the plant was calibrated."""
    found = {}
    for signal in ruleset.signals:
        low, high = signal.valid_from, signal.valid_to
        values = points.values.get(signal.id)
        if values is None or low is None or high is None or signal.id not in ruleset.observed:
            continue
        slack = limits.BEYOND_CALIBRATED * (high - low)
        with np.errstate(invalid="ignore"):
            flags = (values < low - slack) | (values > high + slack)
        if flags.any():
            found[signal.id] = flags
    return found


def below_minimum(signal: SignalSpec) -> str:
    """That a reading is below its minimum, in words."""
    assert signal.minimum is not None
    return f"{signal.id} is below {signal.shown(signal.minimum):.3g} {signal.unit}"


def reason(ruleset: Ruleset, observed: Observed, observer: int, point: int) -> str:
    """Why an estimate is unusable at a point, in words without numbers that would vary."""
    spec = ruleset.observers[observer]
    # Inputs come first: at standstill the speed is the reason, not the pressure.
    inputs_first = sorted(spec.signals, key=lambda s: not ruleset.signal_by_id[s].is_input)
    for name in inputs_first:
        signal = ruleset.signal_by_id[name]
        values = observed.points.values.get(name)
        if values is None and name in observed.points.bad:
            return f"{spec.id}: its module says that it may not be used"
        if values is None:
            return name + NOT_RECORDED
        if not np.isfinite(values[point]):
            return f"{name}: {observed.points.why.get(name) or 'no reading'}"
        if signal.minimum is not None and values[point] < signal.minimum:
            return below_minimum(signal)
    if spec.guards and not np.isfinite(observed.flows[observer, point]):
        return f"{spec.id}: {spec.guards[0].text} is not positive"
    if observed.flows[observer, point] > 0:
        return f"{spec.id}: readings change too fast"
    return f"{spec.id} gives no positive flow"
