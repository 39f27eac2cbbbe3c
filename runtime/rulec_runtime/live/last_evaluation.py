"""The result of the last full update, and of partial updates since."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.sensor_health import Health
from rulec_runtime.diagnosis.steady.findings import Found
from rulec_runtime.diagnosis.steady.independent_parts import Part
from rulec_runtime.live.history import History
from rulec_runtime.live.levels import Levels


@dataclass(frozen=True, kw_only=True)
class PartEvaluation:
    """The evaluation of a part of a plant.

    Attributes
    ----------
    part : the part.
    found : its findings.
    settled : time of its last settled row, s.
    due : number of the row with which it is updated again even if its readings do not move.
    """

    part: Part
    found: Found
    settled: float
    due: float


@dataclass(frozen=True, kw_only=True)
class LastEvaluation:
    """The evaluation of a plant.

    Attributes
    ----------
    diagnosis : as it was last reported.
    health, noise : of the sensors and of the readings, SI, from the last full update.
    count : rows received by then.
    parts : per part of the plant.
    levels : of the readings.
    """

    diagnosis: Diagnosis
    health: Health
    noise: Mapping[str, float]
    count: int
    parts: tuple[PartEvaluation, ...]
    levels: Levels

    def moved(self, flags: np.ndarray) -> set[int]:
        """Indices of the parts with readings that have moved, by flags of signals."""
        names = {name for name, flag in zip(self.levels.names, flags, strict=True) if flag}
        return {i for i, one in enumerate(self.parts) if names & one.part.ruleset.observed}

    def due(self, count: int) -> set[int]:
        """Indices of the parts to update even if their readings do not move."""
        return {i for i, one in enumerate(self.parts) if count >= one.due}


def due_after(whole: History, count: int) -> float:
    """Number of the row with which an update is due even if readings do not move, after one with
    row number `count`: when the last stretch is twice as long, or with the next row if the part is
    not settled."""
    timeline = whole.timeline
    if not len(timeline) or timeline.later[-1] > 0:
        return count + 1.0
    samples = int(timeline.samples[-1])
    return np.inf if samples >= common.LONGEST_STRETCH // 2 else float(count + samples)
