"""Readings that their sensor cannot show.

Source: NAMUR NE 43: a signal of 4 to 20 mA measures from 3.8 to 20.5 mA; at most 3.6 or at least 21
mA signal a failure of the device. So a reading more than 2.5 % of its range below the live zero, or
6.25 % above its end, is invalid.
"""

from collections.abc import Iterator

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.conditions import RANGE, Found, found_in
from rulec_runtime.recordings.columns import median_of, runs_where
from rulec_runtime.recordings.recording import Recording


def out_of_range(recording: Recording, ruleset: Ruleset) -> Iterator[Found]:
    """Runs of such readings."""
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None:
            continue
        for a, b in runs_where(_failed(signal, values), common.PERSISTENCE):
            text = _words(signal, median_of(values[a:b]))
            yield found_in(recording, slice(a, b), RANGE, signal.id, text)


def _failed(signal: SignalSpec, values: Array) -> np.ndarray:
    """Readings, SI, by which a transmitter signals its failure, as flags."""
    low, high = signal.lowest, signal.highest
    if low is None or high is None:
        return np.zeros(len(values), dtype=bool)
    below, above = (share * (high - low) for share in (limits.FAILED_BELOW, limits.FAILED_ABOVE))
    with np.errstate(invalid="ignore"):
        failed: np.ndarray = (values <= low - below) | (values >= high + above)
    return failed


def _words(signal: SignalSpec, usual: float) -> str:
    ends = signal.ends
    shown, low, high = (signal.shown(v) for v in (usual, *ends))
    side = "below its live zero" if usual < ends[0] else "above its range"
    return (
        f"{signal.id} reads {shown:.4g} {signal.unit}, {side} "
        f"({low:.4g} to {high:.4g} {signal.unit}), so it is not a valid reading"
    )
