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
from rulec_runtime.diagnosis.sensors.agreement import Bench
from rulec_runtime.diagnosis.sensors.conditions import Found, dead_in
from rulec_runtime.diagnosis.steady.redundancy import free_flows
from rulec_runtime.recordings.recording import Recording


def dead_readings(recording: Recording, ruleset: Ruleset, bench: Bench) -> Iterator[Found]:
    """Dead readings."""
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or not bench.readers(signal.id).any():
            continue
        zero = at_zero(signal, values)
        if zero.sum() < common.PERSISTENCE:
            continue
        flowing = bench.stretches.first[_flowing(bench, signal, zero, values)]
        runs = dict.fromkeys(_run_around(zero, int(first)) for first in flowing)
        if len(runs) > limits.DIES:
            continue  # a reading that comes back again and again works: the plant causes it
        for first, last in runs:
            yield dead_in(recording, slice(first, last), signal, "other readings show flow")


def at_zero(signal: SignalSpec, values: Array) -> np.ndarray:
    """Samples at which a reading is at zero, at the low end of its range, or below.

    If its usual value is a small part of its range, that value does not count as zero.
    """
    low = signal.offset if signal.lowest is None else signal.lowest
    size = abs(signal.reference - signal.offset)
    if signal.lowest is not None and signal.highest is not None:
        span, usual = signal.highest - signal.lowest, signal.reference - signal.lowest
        size = usual if 0.0 < usual <= limits.AT_ZERO * span else span
    with np.errstate(invalid="ignore"):
        return np.asarray(values <= low + limits.AT_ZERO * size)


def _run_around(zero: np.ndarray, sample: int) -> tuple[int, int]:
    before, behind = zero[:sample][::-1], zero[sample:]
    start = 0 if before.all() else sample - int(np.argmin(before))
    return start, len(zero) if behind.all() else sample + int(np.argmin(behind))


def _flowing(bench: Bench, signal: SignalSpec, zero: np.ndarray, values: Array) -> np.ndarray:
    """Stretches in which a reading is at zero while liquid flows, shape (n,)."""
    stretches = bench.stretches
    inside = np.array(
        [zero[a:b].all() for a, b in zip(stretches.first, stretches.last, strict=True)], dtype=bool
    )
    result = np.zeros(len(stretches), dtype=bool)
    module = signal.id.partition(".")[0]
    frozen = zero.sum() >= common.NEVER_MOVED and _one_value(signal, values)
    for i in np.flatnonzero(inside):
        flow = _flow_without(bench, signal.id, module, int(i))
        if flow is None:
            result[i] = frozen and not signal.is_input and _runs(bench, module, int(i))
        else:
            reference = max(
                abs(o.reference) for o in bench.ruleset.observers if signal.id in o.signals
            )
            there = flow[0] > max(limits.FLOWS_BEYOND * flow[1], limits.FLOWS_PART * reference)
            result[i] = there and not _shows(bench, signal, int(i), *flow)
    return result


def _shows(bench: Bench, signal: SignalSpec, point: int, flow: float, u: float) -> bool:
    """Whether an estimate by a reading is closer to the flow by the others, m3/s, than to the
    estimate with zero in its place. A small part of its range may be all that it should show."""
    ruleset, observed = bench.ruleset, bench.recorded.observed
    own = np.flatnonzero(bench.readers(signal.id) & observed.valid[:, point])
    names = [f"q:{ruleset.observers[i].id}" for i in own]
    plan = ruleset.plan.select(names)
    low = signal.offset if signal.lowest is None else signal.lowest
    values = bench.points.values
    inputs = {name: float(values[name][point]) for name in plan.used_inputs & values.keys()}
    at_low = plan.run({**inputs, signal.id: low})
    for name, shown in zip(names, observed.flows[own, point].tolist(), strict=True):
        zero = float(np.nan_to_num(at_low[name][0]))
        if abs(zero - flow) > limits.FLOWS_BEYOND * u and abs(shown - flow) < abs(shown - zero):
            return True
    return False


def _one_value(signal: SignalSpec, values: Array) -> bool:
    return len(np.unique(values[at_zero(signal, values)])) <= 1


def _flow_without(bench: Bench, signal: str, module: str, point: int) -> tuple[float, float] | None:
    """Flow through a module and its uncertainty, m3/s, by estimates that do not need a signal."""
    observed = bench.recorded.observed
    outside = {name for name, flags in observed.extrapolated.items() if flags[point]}
    inside = [outside.isdisjoint(o.signals) for o in bench.ruleset.observers]
    usable = observed.valid[:, point] & ~bench.readers(signal) & np.array(inside, dtype=bool)
    if not usable.any():
        return None
    table = free_flows(bench.ruleset)
    place = {name: i for i, name in enumerate(bench.ruleset.modules)}
    modules = [place[o.module] for o in bench.ruleset.observers]
    rows = table[np.array(modules)[usable]]
    wanted = table[place[module]]
    covariance = observed.covariance[point][np.ix_(usable, usable)]
    weight = np.linalg.pinv(covariance / np.mean(np.diag(covariance)))
    information = rows.T @ weight @ rows
    inverse = np.linalg.pinv(information, rcond=limits.PSEUDO_INVERSE)
    if np.linalg.norm(wanted - wanted @ inverse @ information) > limits.DETERMINED:
        return None
    gain = wanted @ inverse @ rows.T @ weight
    flow = float(gain @ observed.flows[usable, point])
    return flow, float(np.sqrt(max(gain @ covariance @ gain, 0.0)))


def _runs(bench: Bench, module: str, point: int) -> bool:
    given = [
        s
        for s in bench.ruleset.signals
        if s.is_input and s.minimum is not None and s.id.partition(".")[0] == module
    ]
    values = [bench.points.values[s.id][point] for s in given if s.id in bench.points.values]
    return bool(values) and all(
        v >= s.minimum for v, s in zip(values, given, strict=True) if s.minimum is not None
    )
