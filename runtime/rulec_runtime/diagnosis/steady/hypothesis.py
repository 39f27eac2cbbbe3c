"""The data of hypothesis tests: residuals at points, and their uncertainty."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import remembered, times_of
from rulec_runtime.diagnosis.steady.chi_square import ChiSquare, Metric, metric_of
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import covariance_of, residual_basis


@dataclass(frozen=True)
class Scales:
    """Factors on the errors of each usable flow, shape (flows, points, n), where faults are undone:
    on those new at every point, and on those that last; `sensors` are those that are faulty, whose
    own errors do not scale."""

    noise: Array
    lasting: Array
    sensors: tuple[str, ...] = ()


TimeConstants = tuple[tuple[float, float], ...]
"""Time constants of lasting errors, s, with their shares of the variance."""


@dataclass(frozen=True, kw_only=True)
class HypothesisTest:
    """Problems, n of them, of points that share their usable observers.

    A problem is one point, or several that have the same degrees wherever the faults are present.
    `members` are its points, `present` is 1 where the faults are present and 0 elsewhere, both of
    shape (points, n). Without `time_constants` a point is alone, relative to its baseline.
    `computed` is the metric as measured, if it has been worked out.
    """

    ruleset: Ruleset
    observed: Observed
    valid: np.ndarray
    basis: Array
    members: np.ndarray
    present: Array
    time_constants: TimeConstants = ()
    computed: Metric | None = None
    error_cache: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    def __len__(self) -> int:
        return int(self.members.shape[1])

    def at(self, chosen: np.ndarray | slice) -> HypothesisTest:
        """Some of the problems."""
        members, present = self.members[:, chosen], self.present[:, chosen]
        # A metric is too expensive to work out twice.
        metric = self.computed or self.__dict__.get("metric")
        own = None if metric is None else metric.problems(chosen)
        return replace(self, members=members, present=present, computed=own)

    def at_other_times(self, present: Array) -> HypothesisTest:
        """The problems again, once or more, with the faults present at other points."""
        again = np.tile(np.arange(len(self)), present.shape[1] // len(self))
        metric = self.metric.problems(again)
        return replace(self, members=self.members[:, again], present=present, computed=metric)

    @property
    def freedom(self) -> int:
        """Residuals of a problem."""
        return len(self.members) * len(self.basis)

    @cached_property
    def metric(self) -> Metric:
        """Residuals in the metric of their covariance, as measured."""
        return self.computed or self._metric_of(None)

    def _metric_of(self, scales: Scales | None) -> Metric:
        return metric_of(self.covariance(scales), self.residuals, self.basis)

    def covariance(self, scales: Scales | None = None) -> Array:
        """Covariance of the residuals, as measured or with scaled errors: shape (n, points * rank,
        points * rank), (m3/s)^2."""
        members, basis, rank = self.members, self.basis, len(self.basis)
        points, n = members.shape
        if not self.time_constants:
            return self._alone(members[0], scales)
        shared, noise = self._errors(members)
        if scales is not None:
            names = [name.removeprefix("lag:") for name in self.observed.errors]
            faulty = np.isin(names, scales.sensors)[:, None, None]
            shared = shared * np.where(faulty, scales.lasting[:, None], scales.noise[:, None])
            noise = noise * scales.noise[:, None] * scales.noise
        gradients = (
            np.tensordot(basis, shared, axes=1).transpose(3, 2, 0, 1).reshape(n, -1, len(shared[0]))
        )
        time = times_of(self.observed)[members]
        correlation = sum(
            part * remembered(time[:, None] - time, each) for each, part in self.time_constants
        )
        lasts = np.asarray(correlation).transpose(2, 0, 1)
        whole = (gradients @ gradients.transpose(0, 2, 1)).reshape(n, points, rank, points, rank)
        whole *= lasts[:, :, None, :, None]
        half = np.tensordot(basis, noise, axes=1)
        own = np.tensordot(basis, half, axes=(1, 1)).transpose(3, 2, 0, 1)
        for point in range(points):
            whole[:, point, :, point] += own[:, point]
        return whole.reshape(n, points * rank, points * rank)

    def _alone(self, points: np.ndarray, scales: Scales | None) -> Array:
        if scales is None:
            return covariance_of(self.basis, self.observed.covariance, self.valid, points)
        noise, both = (
            table[points][:, self.valid][:, :, self.valid]
            for table in (self.observed.noise, self.observed.covariance)
        )
        scaled = (
            table * factors[:, 0].T[:, :, None] * factors[:, 0].T[:, None, :]
            for table, factors in ((noise, scales.noise), (both - noise, scales.lasting))
        )
        return np.asarray(self.basis @ sum(scaled) @ self.basis.T)

    def _errors(self, members: np.ndarray) -> tuple[Array, Array]:
        """Slopes of the usable flows by lasting errors, and the covariance of errors new at each
        point, points and problems last."""
        key = members.tobytes()
        if key not in self.error_cache:
            # Kept for the same problems with other residuals, which follow next.
            self.error_cache.clear()
            own, every = np.flatnonzero(self.valid), members.ravel()
            shared = self.observed.shared[..., every][own]
            noise = np.moveaxis(self.observed.noise[every][:, own][:, :, own], 0, -1)
            self.error_cache[key] = (
                shared.reshape(*shared.shape[:2], *members.shape),
                noise.reshape(*noise.shape[:2], *members.shape),
            )
        return self.error_cache[key]

    def rescaled(self, scales: Scales, rows: Sequence[int]) -> ChiSquare:
        """Chi-square with the errors of some flows scaled, where the same flows move, by their
        rows."""
        return self._metric_of(scales).moving(rows)

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
        """The baseline's correction of these flows, same shape."""
        return self._of_usable(self.observed.offsets)

    def _of_usable(self, table: Array) -> Array:
        """The members' part of a table, shape (observers, n), for the usable observers."""
        return np.asarray(table[np.flatnonzero(self.valid)[:, None, None], self.members])

    def in_basis(self, basis: Array) -> HypothesisTest:
        """The same problems in other combinations of the flows, shape (rank, usable flows)."""
        found = replace(self, basis=basis, computed=None)
        # These do not depend on the combinations, so they are worked out once.
        for name in ("flows", "offsets", "each"):
            found.__dict__[name] = getattr(self, name)
        return found

    def effects(self, chosen: Sequence[int] | None = None) -> Array:
        """Slopes of the residuals by a small degree of each fault, or of some by their indexes,
        shape (n, points * rank, faults), m3/s; 0 where the residuals do not show a fault."""
        asked = range(len(self.ruleset.faults)) if chosen is None else chosen
        table = np.zeros((len(self.basis), len(asked), *self.members.shape))
        own = np.zeros((len(asked), len(self)))
        for i, fault in enumerate(asked):
            for row, slope in zip(*self.each.get(fault, ((), ())), strict=True):
                own[i] = np.maximum(own[i], np.max(np.abs(slope), axis=0))
                table[:, i] += self.basis[:, row, None, None] * slope
        residual = self._in_a_row(table * self.present)
        visible = np.sqrt(np.sum(residual**2, axis=1)) > common.UNTOUCHED * own.T
        return np.where(visible[:, None], residual, 0.0)

    @cached_property
    def each(self) -> dict[int, tuple[list[int], Array]]:
        """Per fault of the ruleset, by its index, the rows of the usable flows that it moves, and
        their slopes by a small degree: shape (touched, points, n), m3/s."""
        plan = self.ruleset.undone_slopes(tuple(self.rows))
        inputs: dict[str, Array | float] = {n: 0.0 for n in plan.used_inputs if n.startswith("x:")}
        inputs |= {n: readings.ravel() for n, readings in self.readings(plan.used_inputs).items()}
        slopes, found = plan.run(inputs), {}
        for i, fault in enumerate(self.ruleset.faults):
            observers = [o for o in fault.affects if f"dq:{o}:{fault.id}" in slopes]
            if observers:
                left = self.share_left((fault,), observers)
                own = np.empty((len(observers), self.members.size))
                for row, observer in zip(own, observers, strict=True):
                    row[:] = slopes[f"dq:{observer}:{fault.id}"]
                rows = [self.rows[o] for o in observers]
                found[i] = rows, own.reshape(left.shape) * left * ~self.unread(fault)
        return found

    def towards(self, chosen: Sequence[int] | None = None) -> tuple[Array, Array]:
        """Decrease of half of chi-square per small degree of each fault, or of some by their
        indexes, and information on the degree, both (faults, n); 0 where no usable observer shows
        it."""
        slope = self.effects(chosen)
        information = np.einsum("nrf,nrf->fn", slope, self.metric.inverse @ slope)
        return -np.einsum("nrf,nr->fn", slope, self.metric.weighted), information

    def readings(self, signals: Iterable[str]) -> dict[str, Array]:
        """Readings of those signals that the recording has, shape (points, n)."""
        values = self.observed.points.values
        return {name: values[name][self.members] for name in signals if name in values}

    @cached_property
    def rows(self) -> dict[str, int]:
        """Rows of the usable observers among the usable flows."""
        usable = (o.id for o, v in zip(self.ruleset.observers, self.valid, strict=True) if v)
        return {name: row for row, name in enumerate(usable)}

    def touched(self, faults: tuple[FaultSpec, ...]) -> tuple[str, ...]:
        """Usable observers that some faults bias."""
        return tuple(
            o for o in dict.fromkeys(o for f in faults for o in f.affects) if o in self.rows
        )

    def share_left(self, faults: tuple[FaultSpec, ...], observers: Sequence[str]) -> Array:
        """Share of flows that the baseline leaves, shape (observers, points, n); all if a fault is
        in a sensor, as it takes its errors along."""
        rows = [self.rows[name] for name in observers]
        if any(f.in_sensor for f in faults):
            return np.ones((len(rows), *self.members.shape))
        return self._left[rows]

    @cached_property
    def _left(self) -> Array:
        """Share of each usable flow that the baseline leaves, shape (flows, points, n)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = self.offsets / self.flows
        return 1.0 - np.where(np.isfinite(share), share, 0.0)

    def unread(self, fault: FaultSpec) -> np.ndarray:
        """Where a fault would affect a reading that was removed, shape (points, n)."""
        flags: np.ndarray = np.zeros(self.members.shape, dtype=bool)
        for name, stood_in in self.observed.points.stood_in.items():
            if fault.in_sensor and name in fault.scales:
                flags |= stood_in[self.members]
        return flags

    def _in_a_row(self, table: Array) -> Array:
        """A table of residuals, shape (rank, columns, points, n), as that of the problems, shape
        (n, points * rank, columns)."""
        rank, columns, points, n = table.shape
        return np.ascontiguousarray(table.transpose(3, 2, 0, 1)).reshape(n, points * rank, columns)


def gain_of(pull: Array, information: Array) -> Array:
    """Decrease of chi-square by each degree to first order, from the results of `towards`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.maximum(pull, 0.0) ** 2 / information
    return np.where(information > 0.0, gain, 0.0)


def in_a_row(table: Array) -> Array:
    """A table of touched flows, shape (touched, ..., points, n), as that of the problems, one point
    after the other: shape (points * touched, ..., n)."""
    return np.moveaxis(table, -2, 0).reshape(-1, *table.shape[1:-2], table.shape[-1])


def test_of(
    ruleset: Ruleset, observed: Observed, valid: np.ndarray, members: np.ndarray
) -> HypothesisTest:
    """Test of points on their own, with their covariance."""
    return stacked_test(ruleset, observed, valid, members[None], np.ones((1, len(members))), ())


def stacked_test(
    ruleset: Ruleset,
    observed: Observed,
    valid: np.ndarray,
    members: np.ndarray,
    present: Array,
    time_constants: TimeConstants = ((limits.LASTING, 1.0),),
) -> HypothesisTest:
    """Test of stacks, n of them, of points: a degree that fits one of them must fit all. `members`
    and `present` of shape (points, n)."""
    return HypothesisTest(
        ruleset=ruleset,
        observed=observed,
        valid=valid,
        basis=residual_basis(ruleset, valid),
        members=members,
        present=present,
        time_constants=time_constants,
    )
