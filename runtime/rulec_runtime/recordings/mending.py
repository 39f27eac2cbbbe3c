"""A recording read otherwise than its header says: columns exchanged, in another unit or sign."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from rulec_runtime.recordings.recording import Recording


@dataclass(frozen=True, kw_only=True)
class Mending:
    """What to do with one column, or with the two that stand in each other's place.

    Read as it should be, a column is SI as recorded * factor + offset.
    """

    signals: tuple[str, ...]
    factor: float = 1.0
    offset: float = 0.0

    def of(self, recording: Recording) -> Recording:
        """The recording as it should be read."""
        values = dict(recording.values)
        if len(self.signals) == 2:
            one, other = self.signals
            values[one], values[other] = values[other], values[one]
        else:
            (name,) = self.signals
            values[name] = values[name] * self.factor + self.offset
        return replace(recording, values=values)


def mended(recording: Recording, mendings: Iterable[Mending]) -> Recording:
    """A recording with all columns as they should be read."""
    for mending in mendings:
        recording = mending.of(recording)
    return recording
