"""Readings at zero, or at their live zero, while the others show that liquid flows.

An idle pump, a shut valve and an empty line give zero as well. So a reading is dead only if the
flow through its module, from estimates that do not need it, is far beyond its uncertainty, and no
estimate by the reading agrees. If nothing else gives that flow, a reading that does not even show
noise is dead while its pump runs.
"""

from collections.abc import Iterator

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import Check
from rulec_runtime.diagnosis.sensors.conditions import Found, dead_in
from rulec_runtime.diagnosis.steady.redundancy import free_flows
from rulec_runtime.recordings.columns import runs_where
from rulec_runtime.recordings.recording import Recording


def dead_readings(recording: Recording, ruleset: Ruleset, check: Check) -> Iterator[Found]:
    """Dead readings."""
    first, last = check.stretches.first, check.stretches.last
    for signal in (s for s in ruleset.signals if check.readers(s.id).any()):
        values = recording.values.get(signal.id, np.zeros(0))
        zero = at_zero(signal, values)
        if zero.sum() < common.PERSISTENCE:
            continue
        frozen = zero.sum() >= common.NEVER_MOVED and len(np.unique(values[zero])) <= 1
        runs = [
            run
            for run in runs_where(zero, 1)
            if any(
                _flows(check, signal, point, frozen=frozen)
                for point in np.flatnonzero((first >= run[0]) & (last <= run[1])).tolist()
            )
        ]
        # A reading that comes back again and again works: the plant causes it.
        if len(runs) <= limits.DIES:
            for run in runs:
                yield dead_in(recording, slice(*run), signal, "other readings show flow")


def at_zero(signal: SignalSpec, values: Array) -> np.ndarray:
    """Samples at which a reading is at zero, at the low end of its range, or below.

    If its usual value is a small part of its range, that value does not count as zero.
    """
    size = abs(signal.reference - signal.offset)
    if signal.lowest is not None and signal.highest is not None:
        span, usual = signal.highest - signal.lowest, signal.reference - signal.lowest
        size = usual if 0.0 < usual <= limits.AT_ZERO * span else span
    with np.errstate(invalid="ignore"):
        return np.asarray(values <= _zero(signal) + limits.AT_ZERO * size)


def _zero(signal: SignalSpec) -> float:
    return signal.offset if signal.lowest is None else signal.lowest


def _flows(check: Check, signal: SignalSpec, point: int, *, frozen: bool) -> bool:
    """Whether liquid flows in a stretch in which a reading is at zero."""
    module, values = signal.id.partition(".")[0], check.points.values
    found = _flow_without(check, signal.id, module, point)
    if found is None:
        inputs = [
            values[s.id][point] >= s.minimum
            for s in check.ruleset.signals
            if s.is_input and s.minimum is not None and s.id.partition(".")[0] == module
            if s.id in values
        ]
        return frozen and not signal.is_input and bool(inputs) and all(inputs)
    flow, u = found
    own = check.readers(signal.id)
    read = [o for o, reads in zip(check.ruleset.observers, own, strict=True) if reads]
    reference = max(abs(o.reference) for o in read)
    if flow <= max(limits.FLOWS_BEYOND * u, limits.FLOWS_PART * reference):
        return False
    # A small part of its range may be all that a reading should show: then an estimate by it is
    # closer to the flow by the others than to the estimate with zero in its place.
    own &= check.recorded.valid[:, point]
    names = [f"q:{check.ruleset.observers[i].id}" for i in np.flatnonzero(own)]
    plan = check.ruleset.plan.select(names)
    inputs_of = {name: float(values[name][point]) for name in plan.used_inputs & values.keys()}
    at_low = plan.run({**inputs_of, signal.id: _zero(signal)})
    zero = np.array([np.nan_to_num(at_low[name][0]) for name in names])
    shown = check.recorded.observed.flows[own, point]
    shows = np.abs(shown - flow) < np.abs(shown - zero)
    return not np.any(shows & (np.abs(zero - flow) > limits.FLOWS_BEYOND * u))


def _flow_without(check: Check, signal: str, module: str, point: int) -> tuple[float, float] | None:
    """Flow through a module and its uncertainty, m3/s, by estimates that do not need a signal."""
    observed, observers = check.recorded.observed, check.ruleset.observers
    outside = {name for name, flags in observed.extrapolated.items() if flags[point]}
    inside = np.array([outside.isdisjoint(o.signals) for o in observers], dtype=bool)
    usable = observed.valid[:, point] & ~check.readers(signal) & inside
    for other in check.still:
        usable &= ~check.readers(other)  # a reading without noise proves no flow
    if not usable.any():
        return None
    table = free_flows(check.ruleset)
    index = {name: i for i, name in enumerate(check.ruleset.modules)}
    rows = table[np.array([index[o.module] for o in observers])[usable]]
    wanted = table[index[module]]
    covariance = observed.covariance[point][np.ix_(usable, usable)]
    weight = np.linalg.pinv(covariance / np.mean(np.diag(covariance)))
    information = rows.T @ weight @ rows
    inverse = np.linalg.pinv(information, rcond=limits.PSEUDO_INVERSE)
    if np.linalg.norm(wanted - wanted @ inverse @ information) > limits.DETERMINED:
        return None
    gain = wanted @ inverse @ rows.T @ weight
    flow = float(gain @ observed.flows[usable, point])
    return flow, float(np.sqrt(max(gain @ covariance @ gain, 0.0)))
