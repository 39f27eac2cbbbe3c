"""How well the estimates of a plant agree, with readings as recorded and with other values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TypeVar

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.least_disagreement import LeftOut, left_out
from rulec_runtime.diagnosis.steady.batches import batches
from rulec_runtime.diagnosis.steady.isolate import agreement, alarm_chance, isolate, quantile
from rulec_runtime.diagnosis.steady.many_estimates import at_once, has_many
from rulec_runtime.diagnosis.steady.observe import Observed, observe
from rulec_runtime.diagnosis.steady.points import Points, one_after_the_other, points_of_stretches
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit, residual_basis
from rulec_runtime.recordings.point_table import each_row, is_point_table
from rulec_runtime.recordings.recording import Recording, once
from rulec_runtime.recordings.stationary import (
    Stretches,
    noise_at_work,
    settled_stretches,
    systematic_u,
)

Tried = TypeVar("Tried")
"""A way to read the columns of a recording."""


@dataclass(frozen=True)
class Agreement:
    """Per stretch, shape (n,): chi-square of "no fault" over the `limit` of an alarm, and its
    degrees of freedom; `valid` shape (observers, n). The stretches are the `chosen` of all points
    that were `read` together, which `every` observes."""

    excess: Array
    limit: Array
    freedom: np.ndarray
    valid: np.ndarray
    every: Callable[[slice], Observed]
    read: Points
    chosen: slice

    def part(self, chosen: slice) -> Agreement:
        """Some of all that was observed together."""
        return Agreement(
            self.excess[chosen],
            self.limit[chosen],
            self.freedom[chosen],
            self.valid[:, chosen],
            self.every,
            self.read,
            chosen,
        )

    @cached_property
    def observed(self) -> Observed:
        """The plan's outputs for the stretches."""
        return self.every(self.chosen)

    @property
    def points(self) -> Points:
        return self.read.at(self.chosen)

    @property
    def sound(self) -> np.ndarray:
        """Stretches in which everything comparable agrees."""
        return np.asarray((self.freedom > 0) & (self.excess <= 1.0))


@dataclass(frozen=True)
class Explained:
    """Stretches that agree or that one and the same fault explains, shape (n,); which faults fit,
    the chi-square they leave, their degrees and the uncertainty of these, shape (faults, n)."""

    stretches: np.ndarray
    fits: np.ndarray
    distance: Array
    degree: Array
    u: Array


@dataclass(frozen=True)
class Bench:
    """Settled stretches of a recording; `noise` per signal, SI."""

    ruleset: Ruleset
    stretches: Stretches
    points: Points
    noise: Mapping[str, float]

    @cached_property
    def recorded(self) -> Agreement:
        """For the readings as recorded."""
        return self.agreement(self.points)

    @cached_property
    def left_out(self) -> LeftOut:
        """What each estimate adds to the disagreement of the readings as recorded."""
        return left_out(self.ruleset, self.recorded.observed)

    @cached_property
    def widest_limit(self) -> float:
        """Chi-square of an alarm if every estimate were usable."""
        every = np.ones(len(self.ruleset.observers), dtype=bool)
        freedom = len(residual_basis(self.ruleset, every))
        return chi_square_limit(freedom, self.quantile) if freedom else 0.0

    @property
    def quantile(self) -> float:
        """Normal quantile of an alarm in one of the stretches."""
        return quantile(alarm_chance(len(self.stretches)) / 2)

    @property
    def samples(self) -> int:
        """Samples in all stretches."""
        return int(self.stretches.lengths.sum())

    def with_readings(self, values: Mapping[str, Array], noise: Mapping[str, float]) -> Points:
        """The points with other means of some signals, and other noise of these."""
        points = self.points
        for name, column in values.items():
            systematic = systematic_u(self.ruleset.signal_by_id[name], column)
            u = np.hypot(systematic, noise[name] / np.sqrt(self.stretches.lengths))
            points = points.put(name, column, u, systematic)
        return points

    def agreement(self, points: Points) -> Agreement:
        """How well the estimates agree at points."""
        n = len(points)
        if not has_many(self.ruleset):
            observed = observe(self.ruleset, points)
            return Agreement(*self._agreement(observed), observed.part, points, slice(0, n))

        # Tables of so many estimates are not kept, but made again on demand.
        def some(chosen: slice) -> Observed:
            return observe(self.ruleset, points.at(chosen))

        parts = [self._agreement(some(part)) for part in batches(n, at_once(self.ruleset))]
        excess, limit, freedom, valid = (
            np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)
        )
        return Agreement(excess, limit, freedom, valid, some, points, slice(0, n))

    def _agreement(self, observed: Observed) -> tuple[Array, Array, np.ndarray, np.ndarray]:
        """Chi-square over its limit, that limit, degrees of freedom, and usable estimates."""
        chi, freedom = agreement(self.ruleset, observed)
        limit = [chi_square_limit(f, self.quantile) if f else 1.0 for f in freedom.tolist()]
        return chi / limit, np.array(limit), freedom, observed.valid

    def agreements(
        self, tried: Iterable[Tried], read: Callable[[Tried], Points]
    ) -> Iterator[tuple[Tried, Agreement]]:
        """The same for each way to read, several at a time."""
        n, left = len(self.stretches), iter(tried)
        while some := list(islice(left, max(limits.TRIED_AT_ONCE // n, 1))):
            together = self.agreement(one_after_the_other([read(one) for one in some]))
            for i, one in enumerate(some):
                yield one, together.part(slice(i * n, (i + 1) * n))

    def explained(self, found: Agreement, *, all_tried: bool = True) -> Explained:
        """Sound stretches, and which faults fit where; by default all faults are evaluated."""
        isolation = isolate(self.ruleset, found.observed, all_tried=all_tried, pairs=False)
        fits = isolation.probability > 0
        quiet = isolation.judged & ~isolation.deviating
        each = quiet | (fits & (isolation.freedom > 1))
        best = each[np.argmax(each.sum(axis=1))] if len(each) else quiet
        return Explained(best, fits, isolation.distance, isolation.degree, isolation.u)

    @cached_property
    def explained_as_recorded(self) -> Explained:
        """The same for the readings as recorded."""
        return self.explained(self.recorded)

    @cached_property
    def rivals_as_recorded(self) -> Explained:
        """Faults that fit the readings as recorded; the others are not evaluated."""
        return self.explained(self.recorded, all_tried=False)

    def readers(self, signal: str) -> np.ndarray:
        """Flags of the observers that read a signal."""
        return self._readers.get(signal, np.zeros(len(self.ruleset.observers), dtype=bool))

    @cached_property
    def _readers(self) -> Mapping[str, np.ndarray]:
        count = len(self.ruleset.observers)
        found: dict[str, np.ndarray] = {}
        for i, observer in enumerate(self.ruleset.observers):
            for signal in observer.signals:
                found.setdefault(signal, np.zeros(count, dtype=bool))[i] = True
        return found


@once
def bench_of(recording: Recording, ruleset: Ruleset) -> Bench | None:
    """Settled stretches as in the diagnosis; None if there are none."""
    noise = noise_at_work(recording, ruleset)
    if is_point_table(recording, ruleset):
        stretches = each_row(recording)
    else:
        stretches = settled_stretches(recording, ruleset)
    if not len(stretches) or not ruleset.observers:
        return None
    chosen = np.unique(np.linspace(0, len(stretches) - 1, common.STRETCHES_LOOKED_AT).astype(int))
    some = Stretches(stretches.first[chosen], stretches.last[chosen])
    return Bench(ruleset, some, points_of_stretches(recording, ruleset, some, noise), noise)
