"""Recognise a table of operating points: rows without a course in time.

A bench writes one row per point, averaged and steady. To the search for settled stretches such
rows look like one long transient. The changes from row to row distinguish them: a recording that is
sampled often enough for settled stretches mostly changes by its noise; a table moves at nearly
every row, in several readings at once.

Source: own derivation. In real recordings the median change from row to row is at most 1.1
standard uncertainties of the sensor, in tables of pump curves 4 to 90.
"""

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.columns import median_of
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches, systematic_u, working

NOTE = (
    "readings change at every row by far more than their sensors' uncertainty: each row is taken "
    "as a settled operating point of its own, not as a moment of one run"
)


def is_point_table(recording: Recording, ruleset: Ruleset) -> bool:
    """Whether each row is an operating point of its own.

    True for a pump curve with one row per valve position; False where each position was held and
    sampled several times.
    """
    return len(_moving(recording, ruleset)) >= limits.MOVING_READINGS


def follows_a_course(recording: Recording, ruleset: Ruleset) -> bool:
    """Whether the rows of a table follow each other in time, as in a slow ramp of a plant.

    A run is continuous. A bench restarts each sweep, or takes its points in any order: its column
    of time merely numbers the rows.
    """
    for name in _moving(recording, ruleset):
        values = recording.values[name]
        changes = np.abs(np.diff(values[np.isfinite(values)]))
        spread = float(np.nanstd(values))
        if np.quantile(changes, limits.USUAL_CHANGES) > limits.LEAP * spread:
            return False
    return True


def _moving(recording: Recording, ruleset: Ruleset) -> list[str]:
    """Readings used by observers that usually change from row to row while their module works."""
    found = []
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or signal.id not in ruleset.observed:
            continue
        at_work = values[working(signal, values)]
        if len(at_work) >= limits.FEWEST_POINTS:
            usual, change = median_of(np.abs(at_work)), median_of(np.abs(np.diff(at_work)))
            if change > limits.MOVING_ROWS * float(systematic_u(signal, usual)):
                found.append(signal.id)
    return found


def each_row(recording: Recording) -> Stretches:
    """Every row as a settled stretch of its own."""
    rows = np.arange(len(recording), dtype=np.intp)
    return Stretches(rows, rows + 1)
