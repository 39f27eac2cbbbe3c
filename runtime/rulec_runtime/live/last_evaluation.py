"""The result of the last full update and of partial updates since, and a running update."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.sensor_health import Health
from rulec_runtime.diagnosis.steady.findings import Found
from rulec_runtime.diagnosis.steady.independent_parts import Part
from rulec_runtime.live import limits
from rulec_runtime.live.history import History
from rulec_runtime.live.levels import Levels


@dataclass(frozen=True, kw_only=True)
class PartEvaluation:
    """The evaluation of a part of a plant.

    Attributes
    ----------
    part : the part.
    closed : its operating points before the rows that a partial update judges again.
    found : its findings.
    settled : time of its last settled row, s.
    due : number of the row with which it is updated again even if its readings do not move.
    followed : number of operating points when courses of degrees were last computed.
    """

    part: Part
    closed: History
    found: Found
    settled: float
    due: float
    followed: int

    def after_update(self, whole: History, found: Found, count: int) -> PartEvaluation:
        """The evaluation after a partial update with row number `count`. The next one is due when
        the last stretch is twice as long, or with the next row if the part is not settled."""
        timeline = whole.timeline
        return replace(
            self,
            found=found,
            settled=float(timeline.until[-1]) if len(timeline) else self.settled,
            due=due_after(whole, count),
        )


@dataclass(frozen=True, kw_only=True)
class LastEvaluation:
    """The evaluation of a plant.

    Attributes
    ----------
    diagnosis : as it was last reported.
    health, noise : of the sensors and of the readings, SI, from the last full update.
    count : rows received by then; a partial update judges those from number `cut` on again.
    parts : per part of the plant.
    levels : of the readings.
    """

    diagnosis: Diagnosis
    health: Health
    noise: Mapping[str, float]
    count: int
    cut: int
    parts: tuple[PartEvaluation, ...]
    levels: Levels

    def moved(self, flags: np.ndarray) -> set[int]:
        """Indices of the parts with readings that have moved, by flags of signals."""
        names = {name for name, flag in zip(self.levels.names, flags, strict=True) if flag}
        return {i for i, one in enumerate(self.parts) if names & one.part.ruleset.observed}

    def due(self, count: int) -> set[int]:
        """Indices of the parts to update even if their readings do not move."""
        return {i for i, one in enumerate(self.parts) if count >= one.due}

    @property
    def large(self) -> set[int]:
        """Indices of the parts whose partial update takes longer than until the next row."""
        return {
            i
            for i, one in enumerate(self.parts)
            if len(one.part.ruleset.observed) > limits.SMALL_PLANT
        }


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """The result of a full update.

    Attributes
    ----------
    diagnosis : to be reported.
    settled : time of the last settled row, s; None if nothing settled.
    known : basis of partial updates; None for a plant that gets full updates only.
    cut : number of first rows that exceed memory and become operating points.
    before : operating points of the rows before the remaining ones.
    """

    diagnosis: Diagnosis
    settled: float | None
    known: LastEvaluation | None
    cut: int
    before: History | None


class PendingUpdate(Protocol):
    """A full update that runs elsewhere."""

    def found(self, wait: bool) -> Evaluation | None:
        """Its result; None while it runs, unless the caller waits. Raises what it raised."""

    def drop(self) -> None:
        """Cancel it."""


@dataclass(frozen=True, kw_only=True)
class UpdateUnderWay:
    """A running full update of the rows that had come when it began.

    Attributes
    ----------
    asked : the update.
    count : rows that had come; `kept` is how many of them were in memory.
    updated : indices of the parts that have had a partial update since.
    doubt : whether a sensor has come into doubt since, so that another update is due.
    """

    asked: PendingUpdate
    count: int
    kept: int
    updated: frozenset[int] = frozenset()
    doubt: bool = False


def due_after(whole: History, count: int) -> float:
    """Number of the row with which an update is due even if readings do not move."""
    timeline = whole.timeline
    if not len(timeline) or timeline.later[-1] > 0:
        return count + 1.0
    samples = int(timeline.samples[-1])
    return np.inf if samples >= common.LONGEST_STRETCH // 2 else float(count + samples)
