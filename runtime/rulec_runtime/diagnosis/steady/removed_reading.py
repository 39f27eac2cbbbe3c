"""Replace a removed reading by an unknown, if the estimates know more than it takes to find it.

Three estimates that read a lost pressure are useless without it; but whatever the pressure is, it
is the same for all of them. So the value with the best agreement replaces it, as uncertain as a
guess: the effect of an error in it is no longer evidence, and the rest is. Faults of the lost
reading itself are not detectable.

Source: own derivation; a nuisance parameter, eliminated by a wide prior (generalised least
squares).
"""

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.batches import batches
from rulec_runtime.diagnosis.steady.isolate import agreement, alarm_chance, quantile
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.points import NO_READING, Points, one_after_the_other
from rulec_runtime.diagnosis.steady.redundancy import at_once, chi_square_limit, has_many, thinned


def with_stand_ins(ruleset: Ruleset, points: Points) -> Points:
    """Points with values for removed readings, where more is known with them than without."""
    if has_many(ruleset) or not len(points):
        return points
    for signal in ruleset.signals:
        values = points.values.get(signal.id)
        taken_out = points.why.get(signal.id, NO_READING) != NO_READING
        if values is not None and taken_out and signal.id in ruleset.observed:
            # Stand-ins are expensive, and a finding goes on without some of them.
            lost = thinned(np.flatnonzero(~np.isfinite(values)), limits.STAND_INS)
            value = _value(ruleset, points.at(lost).of(ruleset.observed), signal)
            found, (low, high) = np.isfinite(value), ends_tried(signal)
            if found.any():
                u, at = limits.STAND_IN_SPREAD * (high - low), lost[found]
                points = points.put(signal.id, value[found], u, at=at, stands_in=True)
    return points


def _value(ruleset: Ruleset, points: Points, signal: SignalSpec) -> Array:
    """The value with the best agreement of all estimates, shape (n,), SI; NaN where it gains
    nothing.

    If no value gives agreement, there may be a fault: then it is the value that agrees best
    together with the best fault. The equations are too nonlinear to hold far from there.
    """
    if not len(points):
        return np.zeros(0)
    best, chi, freedom = values_that_agree(ruleset, points, signal)
    without = agreement(ruleset, observe(ruleset, points))[1]
    gained = freedom - 1 > without
    limit = [chi_square_limit(max(f - 1, 1), quantile(alarm_chance(1))) for f in freedom.tolist()]
    off = np.flatnonzero(gained & (chi > limit))
    if len(off):
        best[off] = values_that_agree(ruleset, points.at(off), signal, beside_faults=True)[0]
    return np.where(gained, best, np.nan)


def values_that_agree(
    ruleset: Ruleset, points: Points, signal: SignalSpec, *, beside_faults: bool = False
) -> tuple[Array, Array, np.ndarray]:
    """The value of a reading, SI, at which most can be compared, and agrees best, perhaps beside a
    fault; the chi-square it leaves, and its degrees of freedom: each of shape (n,), n > 0."""
    size = max(at_once(ruleset) // limits.STAND_IN_VALUES, 1)
    parts = (points.at(part) for part in batches(len(points), size))
    found = [_searched(ruleset, part, signal, beside_faults=beside_faults) for part in parts]
    value, chi, freedom = (np.concatenate(each) for each in zip(*found, strict=True))
    return value, chi, freedom


def _searched(
    ruleset: Ruleset, points: Points, signal: SignalSpec, *, beside_faults: bool
) -> tuple[Array, Array, np.ndarray]:
    low, high = ends_tried(signal)
    n, columns = len(points), np.arange(len(points))
    values = np.repeat(np.linspace(low, high, limits.STAND_IN_VALUES + 2)[1:-1, None], n, axis=1)
    u = float(values[1, 0] - values[0, 0])
    for step in range(limits.STAND_IN_ROUNDS + 1):
        tried = one_after_the_other(
            [points.put(signal.id, one, u, stands_in=True) for one in values]
        )
        chi, freedom = (
            table.reshape(values.shape)
            for table in agreement(ruleset, observe(ruleset, tried), beside_faults=beside_faults)
        )
        most = freedom == freedom.max(axis=0)
        order = np.argsort(np.where(most, chi, np.inf), axis=0, kind="stable")
        if step == limits.STAND_IN_ROUNDS:
            break
        # The best value on a coarse grid need not be the best on a fine one.
        u /= 3.0
        chosen = np.take_along_axis(values, order[: limits.STAND_INS_REFINED], axis=0)
        around = chosen[:, None] + u * np.arange(-2.0, 3.0)[:, None]
        values = np.clip(around.reshape(-1, n), low, high)
    best = order[0]
    return values[best, columns], chi[best, columns], freedom[best, columns]


def ends_tried(signal: SignalSpec) -> tuple[float, float]:
    """Range of values tried for a reading, SI."""
    if signal.lowest is not None and signal.highest is not None:
        return signal.lowest, signal.highest
    return limits.TRIED_FROM * signal.reference, limits.TRIED_TO * signal.reference


def of_samples(points: Points, stretches: Points, stretch: np.ndarray) -> Points:
    """Points of samples with the stand-ins of their stretches, by index."""
    for name, flags in stretches.stood_in.items():
        lost = np.flatnonzero(flags[stretch] & ~np.isfinite(points.values[name]))
        value, u = (table[name][stretch[lost]] for table in (stretches.values, stretches.u))
        points = points.put(name, value, u, at=lost, stands_in=True)
    return points
