"""How well the estimates of a plant agree, with readings as recorded and with other values."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, stacked_test
from rulec_runtime.diagnosis.steady.isolate import (
    Isolation,
    accepted,
    agreement,
    alarm_chance,
    isolate,
    quantile,
    tests_of,
)
from rulec_runtime.diagnosis.steady.observe import Observed, observe
from rulec_runtime.diagnosis.steady.points import Points, points_of_stretches
from rulec_runtime.diagnosis.steady.redundancy import (
    at_once,
    chi_square_limit,
    residual_basis,
    spread_evenly,
)
from rulec_runtime.recordings.point_table import each_row, is_point_table
from rulec_runtime.recordings.recording import Recording, once
from rulec_runtime.recordings.standing_still import never_moves
from rulec_runtime.recordings.stationary import (
    Stretches,
    noise_at_work,
    settled_stretches,
    systematic_u,
)


@dataclass(frozen=True)
class Agreement:
    """Per stretch, shape (n,): chi-square of "no fault" over the `limit` of an alarm, and its
    degrees of freedom, by the plan's outputs."""

    observed: Observed
    excess: Array
    limit: Array
    freedom: np.ndarray

    @property
    def valid(self) -> np.ndarray:
        """Usable estimates, shape (observers, n)."""
        return self.observed.valid

    @property
    def sound(self) -> np.ndarray:
        """Stretches in which everything comparable agrees."""
        return np.asarray((self.freedom > 0) & (self.excess <= 1.0))


@dataclass(frozen=True)
class Check:
    """Settled stretches whose estimates are compared; `noise` per signal, SI; readings that stand
    `still` all the time where others move, but for inputs, which may be set."""

    ruleset: Ruleset
    stretches: Stretches
    points: Points
    noise: Mapping[str, float]
    still: Set[str] = frozenset()

    @cached_property
    def recorded(self) -> Agreement:
        """For the readings as recorded."""
        return self.agreement(self.points)

    @cached_property
    def _tests(self) -> list[HypothesisTest]:
        return [*tests_of(self.ruleset, self.recorded.observed)]

    def least(self, observers: np.ndarray) -> Array:
        """Chi-square of the readings as recorded without some observers, by flags, shape (n,).

        No other value of what these read leaves less, so most other ways to read a column need not
        be tried. Source: deletion (Cook and Weisberg 1982).
        """
        found = np.zeros(len(self.stretches))
        for test in self._tests:
            chi = test.metric.moving(np.flatnonzero(observers[test.valid]).tolist())
            block = chi.curvature.transpose(2, 0, 1)
            back = np.linalg.pinv(block, rcond=limits.PSEUDO_INVERSE, hermitian=True)
            gain = np.einsum("in,nij,jn->n", chi.slope, back, chi.slope)
            found[test.members[0]] = chi.value - gain
        return found

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
        observed = observe(self.ruleset, points)
        chi, freedom = agreement(self.ruleset, observed)
        limit = [chi_square_limit(f, self.quantile) if f else 1.0 for f in freedom.tolist()]
        return Agreement(observed, chi / limit, np.array(limit), freedom)

    def agrees_as_a_whole(self, found: Agreement, running: np.ndarray) -> bool:
        """Whether stretches, by flags, agree with the same lasting errors in all of them."""
        points, valid = spread_evenly(found.valid, np.flatnonzero(running))
        present = np.ones((len(points), 1))
        test = stacked_test(self.ruleset, found.observed, valid, points[:, None], present)
        limit = accepted(test.freedom, 0, alarm_chance(len(self.stretches)))
        return bool(test.metric.value[0] <= limit)

    def explained(self, found: Agreement) -> Isolation:
        """Which single faults fit where."""
        return isolate(self.ruleset, found.observed, singles=True)

    @cached_property
    def explained_as_recorded(self) -> Isolation:
        """The same for the readings as recorded."""
        return self.explained(self.recorded)

    def readers(self, signal: str) -> np.ndarray:
        """Flags of the observers that read a signal."""
        return np.array([signal in o.signals for o in self.ruleset.observers], dtype=bool)


@once
def check_of(recording: Recording, ruleset: Ruleset) -> Check | None:
    """Settled stretches as in the diagnosis; None if there are none."""
    noise = noise_at_work(recording, ruleset)
    if is_point_table(recording, ruleset):
        stretches = each_row(recording)
    else:
        stretches = settled_stretches(recording, ruleset)
    if not len(stretches) or not ruleset.observers:
        return None
    most = max(min(common.STRETCHES_LOOKED_AT, at_once(ruleset)), limits.FEWEST_STRETCHES)
    chosen = np.unique(np.linspace(0, len(stretches) - 1, most).astype(int))
    some = Stretches(stretches.first[chosen], stretches.last[chosen])
    points = points_of_stretches(recording, ruleset, some, noise)
    shown = {s.id for s in ruleset.signals if not s.is_input} & recording.values.keys()
    still = frozenset(name for name in shown if never_moves(recording.values[name]))
    return Check(ruleset, some, points, noise, still if still < shown else frozenset())
