"""Test other values of a reading by the nearest residuals.

Each residual bounds chi-square of the whole plant from below. In a large plant a few residuals with
few readings give that bound at a small part of the cost. Their limit has as many degrees of freedom
as there are of them, if that is fewer than the plant's: a disagreement between neighbours drowns in
the noise of hundreds of estimates, but not in that of a few. That test is sharper than the bound;
in a small plant it is the bound.

Source: own derivation; the bound is the Cauchy-Schwarz inequality.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.contract.ruleset import ResidualSpec, Ruleset
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import Bench
from rulec_runtime.diagnosis.steady.observe import plan_inputs, usable_by_readings
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit, patterns_of, residual_basis
from rulec_runtime.recordings.stationary import systematic_u


@dataclass(frozen=True)
class Verdicts:
    """Verdicts on k ways to read a column in n stretches, flags of shape (k, n).

    Attributes
    ----------
    allowed : nothing contradicts this value.
    lost : an estimate that reads it, and that others check, becomes unusable.
    stays : one that reads it is usable.
    """

    allowed: np.ndarray
    lost: np.ndarray
    stays: np.ndarray


@dataclass(frozen=True)
class Near:
    """The residuals of a bench by the readings in them."""

    bench: Bench

    def u(self, signal: str, values: Array, noise: Array) -> Array:
        """Standard uncertainties of other values of a reading, shape (k, n), SI.

        Parameters
        ----------
        values : shape (k, n), SI, k ways to read it in n stretches.
        noise : shape (k,), that of their samples, SI.
        """
        lasting = systematic_u(self._ruleset.signal_by_id[signal], values) + np.zeros(values.shape)
        return np.hypot(lasting, noise[:, None] / np.sqrt(self.bench.stretches.lengths))

    def judge(
        self, signal: str, values: Array, noise: Array, others: Sequence[str | None]
    ) -> Verdicts:
        """Verdicts on values, as in `u`; `others`, (k,), name the other changed reading (None:
        none)."""
        watching = self._watching.get(signal, ())
        allowed: np.ndarray = np.ones(values.shape, dtype=bool)
        lost, stays = np.zeros((2, *values.shape), dtype=bool)
        if not watching or not values.size:
            return Verdicts(allowed, lost, stays)
        limit = chi_square_limit(len(watching), self.bench.quantile)
        limit = min(limit, self.bench.widest_limit)
        out, usable = self._run(signal, values, noise, watching)
        recorded = self.bench.recorded.valid
        for name, there in usable.items():
            observer = self._ruleset.observer_by_id[name]
            place = self._ruleset.observer_index[name]
            if signal not in observer.signals:
                usable[name] = recorded[place] & np.ones_like(there)
                continue
            alone = np.array([other not in observer.signals for other in others])[:, None]
            usable[name] = there & self._still[place]
            stays |= usable[name] & alone
            if self._redundant[place]:
                lost |= recorded[place] & ~there & alone
        for residual in watching:
            size, u = (out[f"{kind}:{residual.id}"].reshape(values.shape) for kind in ("R", "u"))
            with np.errstate(invalid="ignore", over="ignore"):
                off = size**2 > limit * u**2
            for term in residual.terms:
                off &= usable[term.observer]
            # If the residual reads the other one as well, this one alone decides nothing.
            off[[other in self._readings[residual.id] for other in others]] = False
            allowed &= ~off
        return Verdicts(allowed, lost, stays)

    def gains(self, signal: str) -> np.ndarray:
        """Stretches, shape (n,), in which another value may make an unusable estimate usable."""
        return np.asarray(~self.bench.recorded.valid[self.bench.readers(signal)].all(axis=0))

    def _run(
        self, signal: str, values: Array, noise: Array, watching: Sequence[ResidualSpec]
    ) -> tuple[dict[str, Array], dict[str, np.ndarray]]:
        """Outputs of the plan, shape (k * n,), and estimates usable by their readings, shape (k,
        n)."""
        ruleset = self._ruleset
        names = dict.fromkeys(t.observer for r in watching for t in r.terms)
        observers = [ruleset.observer_by_id[name] for name in names]
        if signal not in self._plans:
            outputs = [f"q:{o.id}" for o in observers]
            outputs += [guard.output for o in observers for guard in o.guards]
            outputs += [f"{kind}:{r.id}" for r in watching for kind in ("R", "u")]
            self._plans[signal] = ruleset.plan.selected(dict.fromkeys(outputs)).narrowed()
        plan = self._plans[signal]
        # As recorded but for one reading: one way to read it after the other.
        own = self.bench.points.of({s for o in observers for s in o.signals})
        recorded, u, lag = (
            {name: np.tile(column, len(values)) for name, column in table.items()}
            for table in (own.values, own.u, own.lag)
        )
        recorded[signal] = values.ravel()
        u[signal] = self.u(signal, values, noise).ravel()
        points = Points(recorded, u, {}, {}, {}, None, lag)
        ran = plan.run(plan_inputs(points))
        out = {n: np.broadcast_to(v, (values.size,)) for n, v in ran.items()}
        return out, {
            o.id: usable_by_readings(ruleset, o, points.values, out).reshape(values.shape)
            for o in observers
        }

    @property
    def _ruleset(self) -> Ruleset:
        return self.bench.ruleset

    @cached_property
    def _plans(self) -> dict[str, Plan]:
        return {}

    @cached_property
    def _readings(self) -> dict[str, frozenset[str]]:
        by_id = self._ruleset.observer_by_id
        return {
            r.id: frozenset(s for t in r.terms for s in by_id[t.observer].signals)
            for r in self._ruleset.residuals
        }

    @cached_property
    def _watching(self) -> dict[str, tuple[ResidualSpec, ...]]:
        """Per signal the residuals that read it, those of the fewest readings first."""
        found: dict[str, list[ResidualSpec]] = {}
        for residual in sorted(self._ruleset.residuals, key=lambda r: len(self._readings[r.id])):
            for name in self._readings[residual.id]:
                held = found.setdefault(name, [])
                if len(held) < limits.NEAREST_RESIDUALS:
                    held.append(residual)
        return {name: tuple(held) for name, held in found.items()}

    @cached_property
    def _still(self) -> np.ndarray:
        """Estimates without a lagging reading, shape (observers, n): another value can make them
        usable."""
        points = self.bench.points
        moving = {name: column != 0.0 for name, column in points.lag.items()}
        none = np.zeros(len(points), dtype=bool)
        lagging = [
            np.any([none, *(moving[s] for s in o.signals if s in moving)], axis=0)
            for o in self._ruleset.observers
        ]
        return ~np.array(lagging, dtype=bool).reshape(-1, len(points))

    @cached_property
    def _redundant(self) -> np.ndarray:
        """Estimates that others check in all stretches, shape (observers,)."""
        ruleset, every = self._ruleset, np.ones(len(self._ruleset.observers), dtype=bool)
        for valid, _ in patterns_of(self.bench.recorded.valid):
            basis = residual_basis(ruleset, valid)
            every[valid] &= np.abs(basis).max(axis=0, initial=0.0) > common.LINKED
            every[~valid] = False
        return every
