"""The search for columns and pipes that are not as stated: screened, refitted, accepted or not.

A hypothesis has nothing to fit, so it gains only by being true. It must gain more than the penalty
of its rarity and of the number tried, and it must leave little of the disagreement: one that merely
reduces it is physics that looks similar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from rulec_runtime.recordings.recording import Recording
from scipy.special import expit

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.failing_sensors import impossible
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.hypotheses import AcceptedHypothesis, Hypothesis, hypotheses
from rulec.mismatch.structure.settled import Settled
from rulec.mismatch.structure.wiring import connection_of

if TYPE_CHECKING:
    from rulec.mismatch.structure.stores import Stores


Evidence: TypeAlias = "Settled | Stores"
"""What a kind of plant shows of a recording."""


@dataclass(frozen=True)
class Structure:
    """The corrected recording, the plant as it is connected, and what was not as stated."""

    recording: Recording
    evidence: Evidence
    taken: tuple[AcceptedHypothesis, ...]


def structure_of(
    recording: Recording, evidence: Evidence, progress: Callable[[str], None]
) -> Structure:
    """Correct columns and connections one by one, as long as some are not as stated."""
    found: list[AcceptedHypothesis] = []
    for _ in range(limits.MOST_MISREAD):
        one = _best(recording, evidence, progress) or evidence.clock(recording)
        if one is None:
            break
        found.append(one)
        hypothesis = one.hypothesis
        if hypothesis.mending is not None:
            recording = hypothesis.mending.of(recording)
        elif hypothesis.rewiring is not None and isinstance(evidence, Settled):
            evidence = evidence.rewired(hypothesis.rewiring) or evidence
    return Structure(recording, evidence, tuple(found))


def _best(
    recording: Recording, evidence: Evidence, progress: Callable[[str], None]
) -> AcceptedHypothesis | None:
    plain = evidence.agreement(recording, limits.STRUCTURE_STEPS)
    off = plain.gross >= limits.GROSS_SHARE or plain.idle
    off = off or any(True for _ in impossible(recording, evidence.ruleset))
    column, tried = None, 0
    if off:
        progress("looking for columns that are not what their header says")
        every = list(hypotheses(recording, evidence.ruleset, evidence.read()))
        column, tried = _column(recording, evidence, plain, every), len(every)
    connection = None
    # Wrong parameters partly compensate a wrong network, unlike a wrong column. Connections of a
    # plant that stores are not doubted.
    if isinstance(evidence, Settled) and (off or plain.penalty >= limits.STRAINED):
        progress("looking for connections that are not as the plant file says")
        connection = connection_of(recording, evidence, tried)
    return max((t for t in (column, connection) if t), key=lambda t: t.gain, default=None)


def _column(
    recording: Recording, evidence: Evidence, plain: Agreement, every: list[Hypothesis]
) -> AcceptedHypothesis | None:
    """The column or pair of columns that, read otherwise, makes the rest agree, if any.

    Those that gain most without a refit are refitted, but none that leaves readings unused that
    others can use.
    """
    read = [h.mending.of(recording) for h in every if h.mending is not None]
    first, found = evidence.agreement(recording, 0), [evidence.agreement(r, 0) for r in read]
    rows = max([first.rows, *(one.rows for one in found)])
    gains = np.array([Compared(first.over(rows), one.over(rows)).each for one in found])
    prior = limits.STRUCTURE_ODDS - float(np.log(max(len(every), 1)))
    able = [i for i, one in enumerate(found) if one.rows >= limits.STRUCTURE_READS * rows]
    best, most = None, 0.0
    for i in sorted(able, key=lambda i: -gains[i])[: limits.STRUCTURE_REFITTED]:
        if gains[i] <= 0.0:
            break
        there = evidence.agreement(read[i], limits.STRUCTURE_STEPS)
        compared = Compared(plain.over(rows), there.over(rows))
        probability = float(expit(compared.gain + prior))
        sure = probability > common.CERTAIN and compared.left < limits.STRUCTURE_LEAVES
        if sure and compared.each > most:
            most = compared.each
            best = AcceptedHypothesis(every[i], compared.gain, probability)
    return best
