"""How well a recording agrees with the plain model, as it is and read otherwise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rulec.mismatch.structure import limits


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Comparisons of readings with the plain model, each in units of its noise.

    `rows` is their number, `count` the number of independent ones (one for each operating state).
    Per independent comparison: `likelihood`, its log probability, nats; `excess`, the log of its
    deviation in noise, zero within one; `gross`, whether it deviates grossly. `penalty` is how far
    parameters had to move, as a negative log prior, nats. `idle`: some estimate can hardly ever be
    used, though all its readings are recorded.
    """

    rows: int
    count: float
    likelihood: float
    excess: float
    gross: float
    penalty: float
    idle: bool

    @classmethod
    def none(cls) -> Agreement:
        """Nothing can be compared."""
        return cls(rows=0, count=0.0, likelihood=0.0, excess=0.0, gross=0.0, penalty=0.0, idle=True)

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
        return self.otherwise.count * self.each + self.recorded.penalty - self.otherwise.penalty

    @property
    def left(self) -> float:
        """Remaining share of the disagreement, in logs of its size."""
        before = self.recorded.excess
        return self.otherwise.excess / before if before > 0.0 else 1.0

    @property
    def left_strained(self) -> float:
        """The same with the strain, as wrong values partly compensate a wrong network."""
        count = self.otherwise.count
        before, after = (count * a.excess + a.penalty for a in (self.recorded, self.otherwise))
        return after / before if before > 0.0 else 1.0
