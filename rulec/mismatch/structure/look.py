"""The search for columns that are not what their header says: screened, refitted, taken or not.

A hypothesis has nothing to fit, so what it gains it gains by being true. It must gain more than its
rarity and the number of those that were tried cost, and it must leave little of the disagreement:
what only lessens it is physics that looks alike.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording import Recording
from scipy.special import expit

from rulec.mismatch import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.hypotheses import Hypothesis, Taken, hypotheses


class Evidence(Protocol):
    """What a kind of plant says of a recording."""

    @property
    def ruleset(self) -> Ruleset:
        """The plant."""

    def read(self) -> list[SignalSpec]:
        """Readings that the model reads."""

    def agreement(self, recording: Recording, steps: int) -> Agreement:
        """How well a recording agrees with the plain model, refitted in so many steps."""

    def unread(self, recording: Recording) -> bool:
        """Is there a reading that mostly cannot be?"""

    def clock(self, recording: Recording) -> Taken | None:
        """Columns whose clock is off, if some are."""


def structure_of(
    recording: Recording, evidence: Evidence, progress: Callable[[str], None]
) -> tuple[Recording, tuple[Taken, ...]]:
    """The recording as it should be read, and what was not as its header says."""
    found: list[Taken] = []
    for _ in range(limits.MOST_MISREAD):
        one = _best(recording, evidence, progress) or evidence.clock(recording)
        if one is None:
            break
        found.append(one)
        recording = one.hypothesis.mending.of(recording)
    return recording, tuple(found)


def _best(
    recording: Recording, evidence: Evidence, progress: Callable[[str], None]
) -> Taken | None:
    plain = evidence.agreement(recording, limits.STRUCTURE_STEPS)
    if plain.gross < limits.GROSS_SHARE and not plain.idle and not evidence.unread(recording):
        return None
    progress("looking for columns that are not what their header says")
    every = list(hypotheses(recording, evidence.ruleset, evidence.read()))
    price = limits.STRUCTURE_ODDS - float(np.log(max(len(every), 1)))
    best, most = None, 0.0
    for hypothesis, rows in _promising(recording, evidence, every):
        there = evidence.agreement(hypothesis.mending.of(recording), limits.STRUCTURE_STEPS)
        compared = Compared(plain.over(rows), there.over(rows))
        odds = compared.gain + price
        probability = float(expit(odds))
        sure = probability > limits.CERTAIN and compared.left < limits.STRUCTURE_LEAVES
        if sure and compared.each > most:
            most = compared.each
            best = Taken(hypothesis, compared.gain, probability)
    return best


def _promising(
    recording: Recording, evidence: Evidence, every: list[Hypothesis]
) -> list[tuple[Hypothesis, int]]:
    """Those that gain most without any refit, and how many comparisons there may be.

    What leaves readings unused that others can use is none.
    """
    plain = evidence.agreement(recording, 0)
    found = [evidence.agreement(h.mending.of(recording), 0) for h in every]
    rows = max([plain.rows, *(one.rows for one in found)])
    gains = np.array([Compared(plain.over(rows), one.over(rows)).each for one in found])
    whole = np.array([one.rows >= limits.STRUCTURE_READS * rows for one in found], dtype=bool)
    order = np.argsort(-np.where(whole, gains, -np.inf), kind="stable")
    best = order[: limits.STRUCTURE_REFITTED]
    return [(every[i], rows) for i in best if whole[i] and gains[i] > 0.0]
