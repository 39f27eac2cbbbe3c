"""The search for columns and pipes that are not as stated: screened, refitted, accepted or not.

A hypothesis has nothing to fit, so it gains only by being true. It must gain more than the price of
its rarity and of the number tried, and it must leave little of the disagreement: one that merely
reduces it is physics that looks similar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording import Recording
from scipy.special import expit

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.failing_sensors import impossible
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.hypotheses import (
    CLOCK,
    AcceptedHypothesis,
    Hypothesis,
    Rewiring,
    hypotheses,
)


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Comparisons of readings with the plain model, each in units of its noise.

    `rows` is their number, `count` the number of independent ones (one for each operating state).
    Per independent comparison: `likelihood`, its log probability, nats; `excess`, the log of its
    deviation in noise, zero within one; `gross`, whether it deviates grossly. `strain` is how far
    parameters had to move, as a negative log prior, nats. `idle`: some estimate can hardly ever be
    used, though all its readings are recorded.
    """

    rows: int
    count: float
    likelihood: float
    excess: float
    gross: float
    strain: float
    idle: bool

    @classmethod
    def none(cls) -> Agreement:
        """Nothing can be compared."""
        return cls(rows=0, count=0.0, likelihood=0.0, excess=0.0, gross=0.0, strain=0.0, idle=True)

    def over(self, rows: int) -> Agreement:
        """The same over `rows` comparisons, where missing ones count as far off.

        Otherwise anything that makes a reading impossible would improve the agreement of the rest.
        """
        if self.rows >= rows:
            return self
        share = self.rows / rows
        far = float(np.log(limits.UNREAD))
        return replace(
            self,
            rows=rows,
            likelihood=share * self.likelihood - (1.0 - share) * far,
            excess=share * self.excess + (1.0 - share) * far,
        )


@dataclass(frozen=True)
class Compared:
    """A recording as it is and the same read otherwise, over the same number of rows."""

    recorded: Agreement
    otherwise: Agreement

    @property
    def each(self) -> float:
        """Gain in log probability of one comparison if the recording is read otherwise, nats."""
        return self.otherwise.likelihood - self.recorded.likelihood

    @property
    def gain(self) -> float:
        """Gain in log probability of the whole recording if it is read otherwise, nats."""
        return self.otherwise.count * self.each + self.recorded.strain - self.otherwise.strain

    @property
    def left(self) -> float:
        """Remaining share of the disagreement, in logs of its size."""
        before = self.recorded.excess
        return self.otherwise.excess / before if before > 0.0 else 1.0

    @property
    def left_strained(self) -> float:
        """The same with the strain, as wrong values partly compensate a wrong network."""
        count = self.otherwise.count
        before, after = (count * a.excess + a.strain for a in (self.recorded, self.otherwise))
        return after / before if before > 0.0 else 1.0


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

    def connection(self, recording: Recording, columns: int) -> AcceptedHypothesis | None:
        """A wrong connection, if any; `columns` hypotheses on columns were tried besides."""

    def rewired(self, rewiring: Rewiring) -> Self | None:
        """The plant with other connections; None if that is impossible."""


@dataclass(frozen=True)
class Structure:
    """The corrected recording, the plant as it is connected, and what was not as stated.

    `unshifted` is the same with all clocks as recorded, if one was corrected.
    """

    recording: Recording
    evidence: Evidence
    taken: tuple[AcceptedHypothesis, ...]
    unshifted: Structure | None = None


def structure_of(
    recording: Recording, evidence: Evidence, progress: Callable[[str], None]
) -> Structure:
    """Correct columns and connections one by one, as long as some are not as stated."""
    found: list[AcceptedHypothesis] = []
    unshifted = None
    for _ in range(limits.MOST_MISREAD):
        one = _best(recording, evidence, progress) or evidence.clock(recording)
        if one is None:
            break
        if one.hypothesis.kind == CLOCK and unshifted is None:
            unshifted = Structure(recording, evidence, tuple(found))
        found.append(one)
        hypothesis = one.hypothesis
        if hypothesis.mending is not None:
            recording = hypothesis.mending.of(recording)
        elif hypothesis.rewiring is not None:
            evidence = evidence.rewired(hypothesis.rewiring) or evidence
    return Structure(recording, evidence, tuple(found), unshifted)


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
    # Wrong parameters partly compensate a wrong network, unlike a wrong column.
    if off or plain.strain >= limits.STRAINED:
        progress("looking for connections that are not as the plant file says")
        connection = evidence.connection(recording, tried)
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
