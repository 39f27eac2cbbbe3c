"""What a look at everything found, what partial updates have seen since, and a look under way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.judge import Health
from rulec_runtime.diagnosis.steady.findings import Found
from rulec_runtime.diagnosis.steady.parts import Part, parts_of
from rulec_runtime.live import limits
from rulec_runtime.live.full_update import FullUpdate
from rulec_runtime.live.history import History, only
from rulec_runtime.live.levels import Levels, levels_of


@dataclass(frozen=True, kw_only=True)
class PartEvaluation:
    """What is known of a part of a plant.

    Attributes
    ----------
    part : the part.
    closed : its operating points of rows before those that a partial update judges anew.
    found : what it says.
    settled : time of its last settled row, s.
    due : number of the row with which it is looked at again, whatever its readings do.
    followed : operating points there were when courses of degrees were worked out.
    """

    part: Part
    closed: History
    found: Found
    settled: float
    due: float
    followed: int

    def seen_again(self, whole: History, found: Found, count: int) -> PartEvaluation:
        """After a partial update, with so many rows: the next one is due when what was judged has
        twice as many rows, or with the next row while the part does not stand still."""
        timeline = whole.timeline
        return replace(
            self,
            found=found,
            settled=float(timeline.until[-1]) if len(timeline) else self.settled,
            due=due_after(whole, count),
        )


@dataclass(frozen=True, kw_only=True)
class LastEvaluation:
    """What is known of a plant.

    Attributes
    ----------
    diagnosis : as it was told last.
    health, noise : of the sensors and of readings, SI, by the last look at everything.
    count : rows that had come then; those from number `cut` on are judged anew by a partial update.
    parts : of each part.
    levels : the readings.
    """

    diagnosis: Diagnosis
    health: Health
    noise: Mapping[str, float]
    count: int
    cut: int
    parts: tuple[PartEvaluation, ...]
    levels: Levels

    def moved(self, flags: np.ndarray) -> set[int]:
        """Places of the parts of which readings have moved, by flags of signals."""
        names = {name for name, flag in zip(self.levels.names, flags, strict=True) if flag}
        return {i for i, one in enumerate(self.parts) if names & one.part.ruleset.observed}

    def due(self, count: int) -> set[int]:
        """Places of the parts that are to be looked at, whatever their readings do."""
        return {i for i, one in enumerate(self.parts) if count >= one.due}

    @property
    def large(self) -> set[int]:
        """Places of the parts of which a partial update takes longer than until the next row."""
        sizes = ((i, len(one.part.ruleset.observed)) for i, one in enumerate(self.parts))
        return {i for i, size in sizes if size > limits.SMALL_PLANT}


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What a look at everything found.

    Attributes
    ----------
    diagnosis : what is to be told.
    settled : time of the last settled row, s; None where nothing settled.
    known : what partial updates go on from; None where rows get looks alone.
    cut : rows there is no room for: so many at the beginning become operating points.
    before : operating points of the rows before all others then.
    """

    diagnosis: Diagnosis
    settled: float | None
    known: LastEvaluation | None
    cut: int
    before: History | None


class PendingUpdate(Protocol):
    """A look at everything that goes on elsewhere."""

    def found(self, wait: bool) -> Evaluation | None:
        """What it found; None while it goes on, unless it is to be waited for. What the look
        raised is raised here."""

    def drop(self) -> None:
        """Nobody needs it any more."""


@dataclass(frozen=True, kw_only=True)
class UpdateUnderWay:
    """A look at the rows that had come when it began, while others come.

    Attributes
    ----------
    asked : the look.
    count : rows that had come; `kept` is how many of them were remembered.
    seen : places of the parts that got a partial update since.
    doubt : whether a sensor came into doubt since, so that another look is due.
    """

    asked: PendingUpdate
    count: int
    kept: int
    seen: frozenset[int] = frozenset()
    doubt: bool = False

    def doubted(self, doubt: bool) -> UpdateUnderWay:
        """The same after rows that may have put a sensor in doubt."""
        return replace(self, doubt=self.doubt or doubt)


def evaluation_after(
    ruleset: Ruleset, diagnosis: Diagnosis, judged: FullUpdate, count: int
) -> LastEvaluation:
    """What is known after a look at everything that had come, so many rows."""
    recording, whole = judged.health.recording, judged.whole
    firsts, rows = judged.stretches.first, len(recording)
    open_points = min(1, len(firsts))
    behind = rows - int(firsts[-1]) if open_points else rows
    chosen = np.arange(len(whole)) < len(whole) - open_points
    settled = float(whole.timeline.until[-1])
    parts = tuple(
        PartEvaluation(
            part=part,
            closed=only(whole, part, chosen, behind),
            found=found,
            settled=settled,
            due=due_after(whole, count),
            followed=len(whole),
        )
        for part, found in zip(parts_of(ruleset), judged.found, strict=True)
    )
    levels = levels_of(ruleset, recording, judged.noise)
    values = whole.points.values
    level = np.array([values[n][-1] if n in values else np.nan for n in levels.names])
    rested = np.full(len(level), float(whole.timeline.samples[-1]))
    # A recording keeps what was worked out of it once, which nobody asks for again.
    health = replace(judged.health, recording=replace(recording))
    return LastEvaluation(
        diagnosis=diagnosis,
        health=health,
        noise=judged.noise,
        count=count,
        cut=count - behind,
        parts=parts,
        levels=levels.judged(np.ones(len(level), dtype=bool), level, rested),
    )


def due_after(whole: History, count: int) -> float:
    """Number of the row with which to look again, whatever readings do."""
    timeline = whole.timeline
    if not len(timeline) or timeline.later[-1] > 0:
        return count + 1.0
    samples = int(timeline.samples[-1])
    return np.inf if samples >= common.LONGEST_STRETCH // 2 else float(count + samples)
