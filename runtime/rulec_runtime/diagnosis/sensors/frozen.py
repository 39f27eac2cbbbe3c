"""Readings that never move from the first sample on, while the others show that they should.

A set value is held, a coarse display is constant for long, and a fault moves other readings beside
one that is constant. So the value of such a reading is fitted to the others at each operating
point: with it all estimates must agree; it must move by far more than the sensor's uncertainty; and
no single fault of the plant may explain the recording as well.

Source: own derivation.
"""

from collections.abc import Iterator

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import Check
from rulec_runtime.diagnosis.sensors.conditions import Found, stuck_in
from rulec_runtime.diagnosis.sensors.dead import at_zero
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit
from rulec_runtime.diagnosis.steady.removed_reading import values_that_agree
from rulec_runtime.recordings.columns import median_of
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import last_digit, never_moves


def frozen_readings(recording: Recording, ruleset: Ruleset, check: Check) -> Iterator[Found]:
    """Readings that are frozen from the first sample to the last."""
    recorded = (s for s in ruleset.signals if s.id in recording.values)
    never = [s for s in recorded if never_moves(recording.values[s.id])]
    used = ruleset.observed
    if len(used & set(recording.values)) - len(used & {s.id for s in never}) < limits.FEWEST_MOVING:
        return  # a recording without noise: computed, not measured
    for signal in never:
        shown = median_of(recording.values[signal.id])
        if not check.readers(signal.id).any() or at_zero(signal, np.array([shown])).all():
            continue  # at zero a reading is constant anyway; dead ones were found before
        if _has_noise_elsewhere(check, signal, shown) or _should_move(check, signal):
            because = "it never moves, while the others say that it should"
            yield stuck_in(recording, slice(0, len(recording)), signal, because)


def _has_noise_elsewhere(check: Check, signal: SignalSpec, value: float) -> bool:
    """Whether the same sensor elsewhere shows noise far beyond this one's last digit."""

    def kind(one: SignalSpec) -> tuple[object, ...]:
        return one.id.partition(".")[2], one.kind, one.standard, one.full_scale

    digit = last_digit(signal.shown(value)) * abs(signal.factor)
    return not signal.is_input and any(
        other.id != signal.id
        and kind(other) == kind(signal)
        and check.noise.get(other.id, 0.0) > limits.NOISE_ELSEWHERE * digit
        for other in check.ruleset.signals
    )


def _should_move(check: Check, signal: SignalSpec) -> bool:
    here = check.recorded.freedom > 1
    if not here.any() or (~check.recorded.sound)[here].mean() < limits.DISAGREES_SOMEWHERE:
        return False
    # No value of the reading changes the estimates that do not read it.
    least = check.least(check.readers(signal.id))
    if (least <= check.widest_limit)[here].mean() < common.NEARLY_ALL:
        return False
    # Nor may it make any of them unusable.
    value, chi, freedom = values_that_agree(check.ruleset, check.points, signal)
    limit = [chi_square_limit(max(f, 1), check.quantile) for f in freedom.tolist()]
    excess = np.where(freedom >= check.recorded.freedom, chi / limit, np.inf)
    agrees = here & (excess <= 1.0)
    if agrees[here].mean() < common.NEARLY_ALL:
        return False
    shown = float(np.nanmedian(check.points.values[signal.id]))
    digit = last_digit(signal.shown(shown)) * signal.factor
    u = float(np.nanmedian(check.points.systematic[signal.id]))
    moves, off = np.ptp(value[agrees]), np.abs(value[agrees] - shown).max()
    if max(moves, off) < max(limits.SHOULD_MOVE * u, limits.SHOULD_MOVE_DIGITS * digit):
        return False
    if moves < limits.SHOULD_MOVE * u and digit > limits.FINE_DIGIT * u:
        return False  # a set value or a coarse display with a constant error
    return _beats_faults(check, signal, excess * check.recorded.limit, here)


def _beats_faults(check: Check, signal: SignalSpec, left: Array, here: np.ndarray) -> bool:
    """Whether no fault explains as much, and as well as a free value, by the chi-square that this
    has left, shape (n,).

    A slope error of this reading is no rival: it would leave the reading its noise.
    """
    recorded, explained = check.recorded, check.explained_as_recorded
    fitting = explained.probability > 0.0
    for fault, fits, distance in zip(
        check.ruleset.faults, fitting, explained.distance, strict=True
    ):
        both = here & ~recorded.sound & fits
        own = fault.in_sensor and signal.id in fault.scales
        covers = (fits | recorded.sound)[here].mean() >= common.NEARLY_ALL
        if own or not covers or not both.any():
            continue
        if np.median(distance[both]) < np.median(left[both]) + limits.FROZEN_ODDS:
            return False
    return True
