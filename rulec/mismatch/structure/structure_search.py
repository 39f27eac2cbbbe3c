"""The search for columns and pipes that are not as stated: screened, refitted, accepted or not.

A hypothesis has nothing to fit, so it gains only by being true. It must gain more than the price of
its rarity and of the number tried, and it must leave little of the disagreement: one that merely
reduces it is physics that looks similar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording import Recording
from scipy.special import expit

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.failing_sensors import impossible
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.hypotheses import AcceptedHypothesis, Hypothesis, hypotheses
from rulec.mismatch.structure.settled import Settled
from rulec.mismatch.structure.wiring import connection_of


class Evidence(Protocol):
    """What a kind of plant shows of a recording."""

    @property
    def ruleset(self) -> Ruleset:
        """The plant."""

    def read(self) -> list[SignalSpec]:
        """Readings that the model reads."""

    def agreement(self, recording: Recording, steps: int) -> Agreement:
        """How well a recording agrees with the plain model, refitted in `steps` steps."""

    @property
    def builder(self) -> ModelBuilder:
        """Its models."""

    def clock(self, recording: Recording) -> AcceptedHypothesis | None:
        """Columns with a wrong clock, if any."""


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
    if isinstance(evidence, Settled) and (off or plain.strain >= limits.STRAINED):
        progress("looking for connections that are not as the plant file says")
        connection = connection_of(recording, evidence, tried)
    return max((t for t in (column, connection) if t), key=lambda t: t.gain, default=None)


def _column(
    recording: Recording, evidence: Evidence, plain: Agreement, every: list[Hypothesis]
) -> AcceptedHypothesis | None:
    """The column or pair of columns that, read otherwise, makes the rest agree, if any."""
    price = limits.STRUCTURE_ODDS - float(np.log(max(len(every), 1)))
    best, most = None, 0.0
    for hypothesis, rows in _promising(recording, evidence, every):
        there = evidence.agreement(_read_so(hypothesis, recording), limits.STRUCTURE_STEPS)
        compared = Compared(plain.over(rows), there.over(rows))
        probability = float(expit(compared.gain + price))
        sure = probability > common.CERTAIN and compared.left < limits.STRUCTURE_LEAVES
        if sure and compared.each > most:
            most = compared.each
            best = AcceptedHypothesis(hypothesis, compared.gain, probability)
    return best


def _read_so(hypothesis: Hypothesis, recording: Recording) -> Recording:
    return recording if hypothesis.mending is None else hypothesis.mending.of(recording)


def _promising(
    recording: Recording, evidence: Evidence, every: list[Hypothesis]
) -> list[tuple[Hypothesis, int]]:
    """Hypotheses that gain most without a refit, and the number of comparisons. Those that leave
    readings unused that others can use are excluded."""
    plain = evidence.agreement(recording, 0)
    found = [evidence.agreement(_read_so(h, recording), 0) for h in every]
    rows = max([plain.rows, *(one.rows for one in found)])
    gains = np.array([Compared(plain.over(rows), one.over(rows)).each for one in found])
    whole = np.array([one.rows >= limits.STRUCTURE_READS * rows for one in found], dtype=bool)
    order = np.argsort(-np.where(whole, gains, -np.inf), kind="stable")
    best = order[: limits.STRUCTURE_REFITTED]
    return [(every[i], rows) for i in best if whole[i] and gains[i] > 0.0]
