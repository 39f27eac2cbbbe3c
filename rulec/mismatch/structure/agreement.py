"""How well readings agree with the plain model, and what is gained by reading them otherwise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rulec.mismatch.structure import limits


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Comparisons of readings with the plain model, each in units of its noise.

    `rows` are all of them, `count` those that count (one for each operating state). Per comparison
    that counts: `likelihood`, the log of how probable it is, nats; `excess`, the log of how many
    noises it is off, nothing within one; `gross`, whether it is off by many. `strain` is how far
    parameters had to be moved, as a negative log prior, nats. `idle` tells that some estimate can
    hardly ever be used, though all that it needs is recorded.
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
        """The same over so many rows: what cannot be read is taken as far off.

        Without it whatever makes a reading impossible would make the rest agree.
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
    """A recording as it stands against the same read otherwise, over the same number of rows."""

    recorded: Agreement
    otherwise: Agreement

    @property
    def each(self) -> float:
        """How much more probable a comparison is when the recording is read otherwise, nats."""
        return self.otherwise.likelihood - self.recorded.likelihood

    @property
    def gain(self) -> float:
        """How much more probable the whole recording is when read otherwise, nats."""
        gained = self.otherwise.count * self.each
        return gained + self.recorded.strain - self.otherwise.strain

    @property
    def left(self) -> float:
        """Share of the disagreement that is left, in logs of its size."""
        before = self.recorded.excess
        return self.otherwise.excess / before if before > 0.0 else 1.0

    @property
    def left_strained(self) -> float:
        """The same with how far parameters had to be moved: a wrong network is partly made up for
        by wrong numbers."""
        count = self.otherwise.count
        before, after = (count * a.excess + a.strain for a in (self.recorded, self.otherwise))
        return after / before if before > 0.0 else 1.0
