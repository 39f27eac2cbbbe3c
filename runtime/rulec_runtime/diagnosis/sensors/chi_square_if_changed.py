"""Chi-square with other values of one or two readings, without evaluating all the rest again.

Another value of a reading changes the few estimates that read it, and their errors. The rest of a
large plant is unchanged, and so is most of the inverse of its covariance.

Source: matrix inversion lemma (Woodbury 1950); estimates that drop out, as in `left_out`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import Bench
from rulec_runtime.diagnosis.steady.errors import Gradients, gradients_of
from rulec_runtime.diagnosis.steady.observe import (
    estimate,
    plan_inputs,
    slope_names,
    usable_by_readings,
)
from rulec_runtime.diagnosis.steady.points import Points

Errors = tuple[Gradients, Gradients, Gradients]
"""Gradients of estimates by the noise of readings, by misfits and by lasting errors."""


@dataclass(frozen=True)
class Changed:
    """The changes that other readings make to a bench."""

    bench: Bench
    _plans: dict[str, Plan] = field(default_factory=dict)

    def outcome(self, points: Points, signals: Sequence[str]) -> Outcome:
        """For `points` in which these readings are changed."""
        rows = np.flatnonzero(np.any([self.bench.readers(name) for name in signals], axis=0))
        flows, usable, errors = self._estimated(points, rows, signals)
        return Outcome(self, rows, flows, usable, errors)

    def chi(self, rows: np.ndarray, flows: Array, usable: np.ndarray, errors: Errors) -> Array:
        """Chi-square, shape (n,), with some estimates changed, as in `Outcome`."""
        recorded = self.bench.recorded
        before = recorded.valid[rows]
        both, dropped = before & usable, (before & ~usable).T
        step = np.where(both, flows - recorded.observed.flows[rows], 0.0).T
        every = self._change(rows, errors)
        every *= both[:, None]
        every[:, rows] *= both
        places = np.union1d(rows, np.flatnonzero(every.any(axis=(0, 2))))
        change = every[:, places].transpose(2, 0, 1)
        left, pull, weight = self._moved(places, np.searchsorted(places, rows), step, change)
        if not dropped.any():
            return left
        # Estimates that drop out may have any value.
        block = np.where(dropped[:, :, None] & dropped[:, None], weight, 0.0)
        towards = np.where(dropped, pull, 0.0)
        back = np.linalg.pinv(block, rcond=limits.PSEUDO_INVERSE, hermitian=True)
        return np.asarray(left - np.einsum("ni,nij,nj->n", towards, back, towards))

    def _moved(
        self, places: np.ndarray, rows: np.ndarray, step: Array, change: Array
    ) -> tuple[Array, Array, Array]:
        """Chi-square, shape (n,), with half its first and second derivative by some estimates,
        shapes (n, rows) and (n, rows, rows), when these are moved by a `step`, shape (n, rows).

        `places` are those whose covariance with these changes, by `change`, shape (n, rows,
        places); `rows` are the places of the moved ones among them.
        """
        known = self.bench.left_out
        weight = known.weight[:, places[:, None], places]
        pull = known.pull[:, places] + np.einsum("nij,nj->ni", weight[:, :, rows], step)
        chi = known.chi + np.einsum("nj,nj->n", step, known.pull[:, places[rows]] + pull[:, rows])
        n, count = step.shape
        across = np.zeros((n, len(places), 2 * count))
        across[:, rows, range(count)] = 1.0
        across[:, :, count:] = change.transpose(0, 2, 1)
        weighted = weight @ across
        middle = across.transpose(0, 2, 1) @ weighted
        identity = np.eye(count)
        middle[:, :count, count:] += identity
        middle[:, count:, :count] += identity
        middle[:, count:, count:] += change[:, :, rows]
        towards = np.einsum("nij,ni->nj", across, pull)
        own = weighted[:, rows]
        taken = np.linalg.solve(
            middle, np.concatenate([towards[:, :, None], own.transpose(0, 2, 1)], axis=2)
        )
        back = own @ taken
        return (
            chi - np.einsum("nj,nj->n", towards, taken[:, :, 0]),
            pull[:, rows] - back[:, :, 0],
            weight[:, rows][:, :, rows] - back[:, :, 1:],
        )

    def _estimated(
        self, points: Points, rows: np.ndarray, signals: Sequence[str]
    ) -> tuple[Array, np.ndarray, Errors]:
        """Flows of the observers that read some signals, m3/s, whether they are usable, both of
        shape (rows, n), and their gradients."""
        ruleset, n = self.bench.ruleset, len(points)
        out: dict[str, Array] = {}
        for signal in signals:
            plan = self._plan(signal)
            read = {name: points.values[name] for name in plan.used_inputs & points.values.keys()}
            units = dict.fromkeys(read, np.ones(n))
            lagging = replace(points, values=read)
            out |= plan.run(plan_inputs(lagging, units))
        out = {k: v if v.shape == (n,) else np.broadcast_to(v, (n,)) for k, v in out.items()}
        slopes = {name: column for name, column in out.items() if name.startswith("s:")}
        scatter, misfits, lasting, late = gradients_of(ruleset, points, slopes, n)
        observers = [ruleset.observers[i] for i in rows]
        flows = np.array([out[f"q:{o.id}"] for o in observers])
        usable = np.array([usable_by_readings(ruleset, o, points.values, out) for o in observers])
        with np.errstate(invalid="ignore"):
            usable &= np.isfinite(flows) & (np.sqrt(late[rows]) <= common.TOO_FAST * np.abs(flows))
        return flows, usable, (scatter, misfits, lasting)

    def _plan(self, signal: str) -> Plan:
        """The estimates of observers that read a signal, and their slopes."""
        if signal not in self._plans:
            names = []
            for i in np.flatnonzero(self.bench.readers(signal)).tolist():
                observer = self.bench.ruleset.observers[i]
                names += [f"q:{observer.id}", *(guard.output for guard in observer.guards)]
                names += self._slopes.get(i, ())
            plan = self.bench.ruleset.plan.selected(dict.fromkeys(names))
            self._plans[signal] = plan.narrowed()
        return self._plans[signal]

    def _change(self, rows: np.ndarray, errors: Errors) -> Array:
        """Change of the covariance of some estimates with all, shape (rows, observers, n),
        (m3/s)^2; zero where one of them was not usable."""
        recorded, n = self.bench.recorded, len(self.bench.stretches)
        place = np.full(len(recorded.valid), -1)
        place[rows] = range(len(rows))
        found = -np.moveaxis(recorded.observed.covariance, 0, -1)[rows]
        nothing = np.zeros(0, dtype=int), np.zeros((0, n))
        with np.errstate(invalid="ignore", over="ignore"):
            for mine, before in zip(errors, self._errors, strict=True):
                for error, own in mine.items():
                    if own:
                        others, table = before.get(error, nothing)
                        there = place[others] < 0
                        here, new = np.array([*own]), np.array([*own.values()])
                        others = np.concatenate([others[there], here])
                        table = np.concatenate([table[there], new])
                        found[place[here][:, None], others] += new[:, None] * table
        return np.where(recorded.valid & np.isfinite(found), found, 0.0)

    @cached_property
    def _errors(self) -> list[dict[str, tuple[np.ndarray, Array]]]:
        """Gradients of all estimates as recorded, by kind and error: places and table (places,
        n)."""
        ruleset, points = self.bench.ruleset, self.bench.points
        slopes, n = estimate(ruleset, points).slopes, len(points)
        with np.errstate(invalid="ignore"):
            kinds = gradients_of(ruleset, points, slopes, n)[:3]
        return [
            {
                error: (
                    np.array([*column], dtype=int),
                    np.array([np.broadcast_to(one, (n,)) for one in column.values()]),
                )
                for error, column in kind.items()
                if column
            }
            for kind in kinds
        ]

    @cached_property
    def _slopes(self) -> Mapping[int, list[str]]:
        """Names of the slopes of each observer, by its place."""
        ruleset = self.bench.ruleset
        found: dict[int, list[str]] = {}
        for name in slope_names(ruleset):
            found.setdefault(ruleset.observer_index[name.split(":")[1]], []).append(name)
        return found


@dataclass(frozen=True)
class Outcome:
    """The result in n stretches: `flows` of the observers in `rows`, m3/s, and whether they are
    `usable`, both of shape (rows, n), with their `errors`."""

    changed: Changed
    rows: np.ndarray
    flows: Array
    usable: np.ndarray
    errors: Errors

    @property
    def used(self) -> np.ndarray:
        """Stretches, shape (n,), in which some estimate by the other readings is usable."""
        return np.asarray(self.usable.any(axis=0))

    @property
    def more(self) -> np.ndarray:
        """Those in which one is usable that was not before."""
        return np.asarray((self.usable & ~self._before).any(axis=0))

    @property
    def fewer(self) -> np.ndarray:
        """Those in which one that others check is no longer usable."""
        bench, rows = self.changed.bench, self.rows
        weight = bench.left_out.weight[:, rows, rows].T
        size = bench.recorded.observed.covariance[:, rows, rows].T
        with np.errstate(invalid="ignore"):
            checked = weight * size > common.LINKED
        return np.asarray((self._before & ~self.usable & checked).any(axis=0))

    @property
    def chi(self) -> Array:
        """Chi-square with the other readings, shape (n,); unknown where there are `more`."""
        return self.changed.chi(self.rows, self.flows, self.usable, self.errors)

    @property
    def _before(self) -> np.ndarray:
        return np.asarray(self.changed.bench.recorded.valid[self.rows])
