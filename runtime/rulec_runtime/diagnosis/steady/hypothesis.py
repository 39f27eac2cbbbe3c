"""In what hypotheses are tested: residuals at points, and by how much these may be off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.steady.batches import of_points
from rulec_runtime.diagnosis.steady.chi_square import Metric, inverse_of
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.recordings.scratch import let_go


@dataclass(frozen=True)
class Scales:
    """Factors on the errors of each usable flow, shape (flows, points, n), where faults are undone:
    on what is new at every point, and on what lasts."""

    noise: Array
    lasting: Array


@dataclass(frozen=True, kw_only=True)
class HypothesisTest:
    """Problems, n of them, of points that share their usable observers.

    A problem is one point, or several that have the same degrees wherever the faults are present.
    `members` are its points, `present` is 1 where the faults are there and 0 elsewhere, both of
    shape (points, n). `spread` gives the covariance of the residuals of problems with such members,
    shape (n, points * rank, points * rank), as measured or with the errors of each usable flow
    scaled; `known` is the metric as measured, where it has been worked out.
    """

    ruleset: Ruleset
    observed: Observed
    valid: np.ndarray
    basis: Array
    members: np.ndarray
    present: Array
    spread: Callable[[np.ndarray, Scales | None], Array]
    known: Metric | None = None

    def __len__(self) -> int:
        return int(self.members.shape[1])

    def at(self, chosen: np.ndarray | slice) -> HypothesisTest:
        """Some of the problems."""
        members, present = self.members[:, chosen], self.present[:, chosen]
        return replace(self, members=members, present=present, known=None)

    def at_other_times(self, present: Array) -> HypothesisTest:
        """The problems again, once or more, with the faults present at other points."""
        again = np.tile(np.arange(len(self)), present.shape[1] // len(self))
        known = self.metric.problems(again)
        return replace(self, members=self.members[:, again], present=present, known=known)

    @property
    def freedom(self) -> int:
        """Residuals of a problem."""
        return len(self.members) * len(self.basis)

    @cached_property
    def metric(self) -> Metric:
        """Residuals in the metric of their covariance, as measured."""
        return self.known or self.metric_of(None)

    def metric_of(self, scales: Scales | None) -> Metric:
        """The same with scaled errors."""
        inverse = inverse_of(self.spread(self.members, scales))
        return Metric(inverse, self.residuals, self.basis)

    @cached_property
    def residuals(self) -> Array:
        """Residuals as measured, shape (n, points * rank)."""
        table = np.tensordot(self.basis, self.flows - self.offsets, axes=1)
        return self._in_a_row(table[:, None])[:, :, 0]

    @cached_property
    def flows(self) -> Array:
        """Usable flows, shape (usable observers, points, n)."""
        return self._of_usable(self.observed.flows)

    @cached_property
    def offsets(self) -> Array:
        """What the baseline takes from them."""
        return self._of_usable(self.observed.offsets)

    def _of_usable(self, table: Array) -> Array:
        """The members' part of a table, shape (observers, n), of the usable observers."""
        found = of_points(table, (np.flatnonzero(self.valid),), self.members.ravel())
        return found.reshape(-1, *self.members.shape)

    def effects(self) -> Array:
        """Slopes of the residuals by the degree of each fault of the ruleset, at a small one: shape
        (n, points * rank, faults), m3/s; 0 where the residuals do not see a fault."""
        faults = self.ruleset.faults
        table = np.zeros((len(self.basis), len(faults), *self.members.shape))
        own = np.zeros((len(faults), len(self)))
        slopes = self._undone_at_zero()
        for i, fault in enumerate(faults):
            observers = [o for o in fault.affects if f"dq:{o}:{fault.id}" in slopes]
            for observer, kept in zip(observers, self.kept((fault,), observers), strict=True):
                slope = slopes[f"dq:{observer}:{fault.id}"].reshape(kept.shape) * kept
                own[i] = np.maximum(own[i], np.max(np.abs(slope), axis=0))
                table[:, i] += self.basis[:, self.places[observer], None, None] * slope
        residual = self._in_a_row(table * self.present)
        visible = np.sqrt(np.sum(residual**2, axis=1)) > limits.UNTOUCHED * own.T
        return np.where(visible[:, None], residual, 0.0)

    def towards(self) -> tuple[Array, Array]:
        """How much a small degree of each fault lowers half of chi-square per degree, and the
        information on the degree, both shape (faults, n); 0 where no usable observer shows it."""
        pull, information = np.zeros((2, len(self.ruleset.faults), len(self)))
        for part in self.portions():
            slope = self.at(part).effects()
            weighted = self.metric.inverse[part] @ slope
            information[:, part] = np.einsum("nrf,nrf->fn", slope, weighted)
            pull[:, part] = -np.einsum("nrf,nr->fn", slope, self.metric.weighted[part])
        return pull, information

    def portions(self) -> Iterator[slice]:
        """Problems in portions whose effects do not take much memory."""
        size = max(limits.TABLE // max(self.freedom * len(self.ruleset.faults), 1), 1)
        for low in range(0, len(self), size):
            yield slice(low, low + size)

    def readings(self, signals: Iterable[str]) -> dict[str, Array]:
        """Readings of those of some signals that the recording has, shape (points, n)."""
        values = self.observed.points.values
        found = {name: values[name][self.members] for name in signals if name in values}
        let_go(*(values[name] for name in found))
        return found

    @cached_property
    def places(self) -> dict[str, int]:
        """Places of the usable observers among the usable flows."""
        usable = (o.id for o, v in zip(self.ruleset.observers, self.valid, strict=True) if v)
        return {name: place for place, name in enumerate(usable)}

    def touched(self, faults: tuple[FaultSpec, ...]) -> tuple[str, ...]:
        """Usable observers that some faults make wrong."""
        return tuple(
            o for o in dict.fromkeys(o for f in faults for o in f.affects) if o in self.places
        )

    def kept(self, faults: tuple[FaultSpec, ...], observers: Sequence[str]) -> Array:
        """Share of flows that the baseline leaves, shape (observers, points, n); a fault in a
        sensor takes its errors along."""
        places = [self.places[name] for name in observers]
        kept = np.ones((len(places), *self.members.shape))
        if not any(f.in_sensor for f in faults):
            with np.errstate(divide="ignore", invalid="ignore"):
                share = self.offsets[places] / self.flows[places]
            kept -= np.where(np.isfinite(share), share, 0.0)
        return kept

    def _undone_at_zero(self) -> dict[str, Array]:
        """Slopes of the usable flows by degrees of zero, shape (points * n,), by the names that
        they have in the plan."""
        plan = self.ruleset.undone_slopes(tuple(self.places))
        inputs: dict[str, Array | float] = {n: 0.0 for n in plan.used_inputs if n.startswith("x:")}
        inputs |= {n: readings.ravel() for n, readings in self.readings(plan.used_inputs).items()}
        return {
            name: np.broadcast_to(slope, (self.members.size,))
            for name, slope in plan.run(inputs).items()
        }

    def _in_a_row(self, table: Array) -> Array:
        """A table of residuals, shape (rank, columns, points, n), as one of the problems, shape
        (n, points * rank, columns)."""
        rank, columns, points, n = table.shape
        return np.ascontiguousarray(table.transpose(3, 2, 0, 1)).reshape(n, points * rank, columns)
