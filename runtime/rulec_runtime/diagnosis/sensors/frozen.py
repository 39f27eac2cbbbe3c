"""Readings that never move from the first sample on, while the others show that they should.

A set value is held, a coarse display is constant for long, and a fault moves other readings beside
one that is constant. So the value of such a reading is fitted to the others at each operating
point: with it all estimates must agree; it must move by far more than the sensor's uncertainty; and
no single fault of the plant may explain the recording as well.

Source: own derivation.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import Bench
from rulec_runtime.diagnosis.sensors.conditions import Found, stuck_in
from rulec_runtime.diagnosis.sensors.dead import at_zero
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit
from rulec_runtime.diagnosis.steady.removed_reading import values_that_agree
from rulec_runtime.recordings.columns import first_reading
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import last_digit, never_moves


@dataclass(frozen=True)
class Freed:
    """Per stretch, shape (n,): the value, SI, that suits the others best, and the misfit left."""

    value: Array
    excess: Array


def frozen_readings(recording: Recording, ruleset: Ruleset, bench: Bench) -> Iterator[Found]:
    """Readings that are frozen from the first sample to the last."""
    recorded = (s for s in ruleset.signals if s.id in recording.values)
    never = [s for s in recorded if never_moves(recording.values[s.id])]
    used = ruleset.observed
    if len(used & set(recording.values)) - len(used & {s.id for s in never}) < limits.FEWEST_MOVING:
        return  # a recording without noise: computed, not measured
    for signal in never:
        here = bench.recorded.freedom > 1
        known = np.array([_only(recording, signal.id)])
        if not bench.readers(signal.id).any() or at_zero(signal, known).all():
            continue  # at zero a reading is constant anyway; dead ones were found before
        if _has_noise_elsewhere(recording, ruleset, bench, signal) or (
            here.any() and _should_move(bench, signal, here)
        ):
            because = "it never moves, while the others say that it should"
            yield stuck_in(recording, slice(0, len(recording)), signal, because)


def _has_noise_elsewhere(
    recording: Recording, ruleset: Ruleset, bench: Bench, signal: SignalSpec
) -> bool:
    """Whether the same sensor elsewhere shows noise far beyond this one's last digit."""
    if signal.is_input:
        return False
    digit = last_digit(signal.shown(_only(recording, signal.id))) * abs(signal.factor)
    name = signal.id.partition(".")[2]
    return any(
        other.id != signal.id
        and other.id.partition(".")[2] == name
        and (other.kind, other.standard, other.full_scale)
        == (signal.kind, signal.standard, signal.full_scale)
        and bench.noise.get(other.id, 0.0) > limits.NOISE_ELSEWHERE * digit
        for other in ruleset.signals
    )


def _only(recording: Recording, name: str) -> float:
    value = first_reading(recording.values[name])
    assert value is not None
    return value


def _should_move(bench: Bench, signal: SignalSpec, here: np.ndarray) -> bool:
    if (~bench.recorded.sound)[here].mean() < limits.DISAGREES_SOMEWHERE:
        return False
    # No value of the reading changes the estimates that do not read it.
    least = bench.least(bench.readers(signal.id))
    if (least <= bench.widest_limit)[here].mean() < common.NEARLY_ALL:
        return False
    freed = free(bench, signal)
    agrees = freed.excess[here] <= 1.0
    if agrees.mean() < common.NEARLY_ALL:
        return False
    shown = float(np.nanmedian(bench.points.values[signal.id]))
    digit = last_digit(signal.shown(shown)) * signal.factor
    u = float(np.nanmedian(bench.points.systematic[signal.id]))
    moves = np.ptp(freed.value[here][agrees])
    off = np.abs(freed.value[here][agrees] - shown).max()
    if max(moves, off) < max(limits.SHOULD_MOVE * u, limits.SHOULD_MOVE_DIGITS * digit):
        return False
    if moves < limits.SHOULD_MOVE * u and digit > limits.FINE_DIGIT * u:
        return False  # a set value or a coarse display with a constant error
    return _beats_faults(bench, signal, freed, here)


def _beats_faults(bench: Bench, signal: SignalSpec, freed: Freed, here: np.ndarray) -> bool:
    """Whether no fault explains as much, and as well.

    A slope error of this reading is no rival: it would leave the reading its noise.
    """
    recorded, explained = bench.recorded, bench.explained_as_recorded
    off = here & ~recorded.sound
    fitting = explained.probability > 0.0
    of_faults = zip(bench.ruleset.faults, fitting, explained.distance, strict=True)
    for fault, fits, distance in of_faults:
        if fault.in_sensor and signal.id in fault.scales:
            continue
        both = off & fits
        if (fits | recorded.sound)[here].mean() >= common.NEARLY_ALL and both.any():
            left = float(np.median(distance[both]))
            if left < np.median((freed.excess * recorded.limit)[both]) + limits.FROZEN_ODDS:
                return False
    return True


def free(bench: Bench, signal: SignalSpec) -> Freed:
    """Fit the value of a reading that makes all estimates agree best, at each stretch, and lets
    none of them become unusable."""
    value, chi, freedom = values_that_agree(bench.ruleset, bench.points, signal)
    limit = [chi_square_limit(max(f, 1), bench.quantile) for f in freedom.tolist()]
    return Freed(value, np.where(freedom >= bench.recorded.freedom, chi / limit, np.inf))
