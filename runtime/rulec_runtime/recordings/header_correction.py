"""Correct a recording whose header is wrong: columns swapped, in another unit or sign, or shifted
in time."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.columns import interval_of, nearest
from rulec_runtime.recordings.recording import Recording


@dataclass(frozen=True, kw_only=True)
class Mending:
    """The correction of one column, of two swapped columns, or of columns from a clock that is
    `late`, s (negative: early).

    A corrected column is SI as recorded * factor + offset.
    """

    signals: tuple[str, ...]
    factor: float = 1.0
    offset: float = 0.0
    late: float = 0.0

    def of(self, recording: Recording) -> Recording:
        """The corrected recording."""
        values = dict(recording.values)
        if self.late:
            values |= {name: self._in_time(recording, values[name]) for name in self.signals}
        elif len(self.signals) == 2:
            one, other = self.signals
            values[one], values[other] = values[other], values[one]
        else:
            (name,) = self.signals
            values[name] = values[name] * self.factor + self.offset
        return replace(recording, values=values)

    def _in_time(self, recording: Recording, values: Array) -> Array:
        """Readings at the time at which they were taken, shape (n,): from the nearest row of the
        same file, NaN if none is within half the usual distance of rows."""
        found = np.full(len(values), np.nan)
        for segment in np.unique(recording.segment):
            rows = np.flatnonzero(recording.segment == segment)
            time = recording.time[rows]
            wanted = time + self.late
            near = nearest(time, wanted)
            there = np.abs(time[near] - wanted) <= 0.5 * interval_of(time, 0.0)
            found[rows[there]] = values[rows[near[there]]]
        return found


def mended(recording: Recording, mendings: Iterable[Mending]) -> Recording:
    """A recording with all corrections."""
    for mending in mendings:
        recording = mending.of(recording)
    return recording
