"""Readings of a plant that stores, against what its balances predict from the inputs.

From their nominal start, balances predict no exact level, but whether there should be one, and
whether it should move.
"""

from collections.abc import Iterator

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.conditions import Found, dead_in, stuck_in
from rulec_runtime.diagnosis.sensors.dead import at_zero
from rulec_runtime.diagnosis.stores.free_balances import nominal_starts, start_of, with_free_states
from rulec_runtime.recordings.columns import filled
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import last_digit, never_moves
from rulec_runtime.recordings.stationary import systematic_u


def silent_readings(recording: Recording, ruleset: Ruleset) -> Iterator[Found]:
    """Readings that never move: dead or frozen."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    names = [n for n in dynamics.outputs if n in recording.values]
    silent = [n for n in names if never_moves(recording.values[n])]
    if not silent or not recording.values.keys() >= set(dynamics.inputs):
        return
    if not any(np.nanstd(recording.values[n]) > 0 for n in dynamics.inputs):
        return
    # Every output by the balances as they are; none without inputs.
    table = np.column_stack([filled(recording.values[n]) for n in dynamics.inputs])
    starts = zip(dynamics.states, nominal_starts(dynamics).tolist(), strict=True)
    values = {**dynamics.values, **{start_of(s.id): start for s, start in starts}}
    held = np.array([ruleset.signal_by_id[n].between == "hold" for n in dynamics.inputs])
    found = with_free_states(dynamics).run(recording.time, table, held, values).shown
    predicted, every = dict(zip(dynamics.outputs, found.T, strict=True)), slice(0, len(recording))
    for name in silent:
        signal, course = ruleset.signal_by_id[name], predicted[name]
        if not np.isfinite(course).all():
            continue
        shown = recording.values[name][np.isfinite(recording.values[name])]
        low, high = signal.lowest, signal.highest
        if at_zero(signal, shown).all():
            span = abs(signal.reference) if low is None or high is None else high - low
            end = signal.offset if low is None else low
            if np.median(course) > end + limits.LEVEL_THERE * span:
                because = "the balances show that it is not empty"
                yield dead_in(recording, every, signal, because)
        elif high is None or shown[0] < high:
            # The balances must move it by more than its sensor and its display hide.
            u = float(np.median(systematic_u(signal, course)))
            digit = last_digit(signal.shown(float(shown[0]))) * abs(signal.factor)
            smallest = max(limits.SHOULD_MOVE_STORES * u, limits.SHOULD_MOVE_DIGITS * digit)
            if np.ptp(course) > smallest:
                because = "it never moves, while the balances say that it should"
                yield stuck_in(recording, every, signal, because)
