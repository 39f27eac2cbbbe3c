"""The integral that a refit takes by Laplace's approximation, by nested sampling.

What a refit chooses stays as it chose: noise, sizes of random columns, forms of effects. Values are
drawn from a wide Student distribution about the model and weighed by what that is less than the
prior; the model is evaluated anew for each. Random columns are integrated out exactly where noise
is normal, and drawn too where it is not.

Source: Skilling 2006 (nested sampling); Speagle 2020 (dynesty); Petrosyan and Handley 2022 (another
prior leaves the evidence as it is).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from dynesty import NestedSampler
from rulec_runtime.contract.plan import Array
from scipy.special import stdtrit

from rulec.knowledge.belief import peak_of
from rulec.mismatch.search.evidence import Evidence
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.stores.geometry import StoresGeometry

WIDER = 1.3
"""Times that the distribution from which is drawn is as wide as the model's."""

FREEDOM = 3.0
"""Degrees of freedom of that: as few as those of what is known of parameters."""

MOST = 10000
"""Evaluations of a model at most."""

IMPOSSIBLE = -1e10
"""Log density where no value may be, or the model has none."""


@dataclass(frozen=True)
class Integral:
    """The integral of a model's density over its values and, where they are `drawn`, the numbers of
    its random columns."""

    geometry: Evidence
    model: Model

    @property
    def drawn(self) -> bool:
        """Are the numbers of random columns drawn?"""
        return isinstance(self.geometry, Geometry)

    @cached_property
    def free(self) -> Array:
        """Places of the values that are not held."""
        return np.flatnonzero(self.model.prior.highest > self.model.prior.lowest)

    @cached_property
    def columns(self) -> Array:
        """Random columns, whitened, each of its size, shape (rows, columns)."""
        return self.model.table[:, len(self.model.at) :]

    @cached_property
    def _inner(self) -> Array:
        """Lower factor of what integrates the columns out."""
        return np.linalg.cholesky(np.eye(self.columns.shape[1]) + self.columns.T @ self.columns)

    @cached_property
    def _linear(self) -> Array:
        """Where the model made linear is the most probable, values less their means."""
        model = self.model
        pull = model.table.T @ (model.weights * model.left)
        normal = model.table.T @ (model.table * model.weights[:, None]) + model.precision
        return -np.linalg.solve(normal, pull)

    @cached_property
    def about(self) -> tuple[Array, Array]:
        """Middle, and lower factor of the scales, of the distribution from which is drawn."""
        model, n = self.model, len(self.model.at)
        slopes = self.geometry.whitened(model.point.jacobian[:, self.free], model.noise)
        table = np.concatenate([slopes, self.columns], axis=1)
        kept = np.concatenate([self.free, np.arange(n, len(model.precision))])
        precision = model.precision[np.ix_(kept, kept)]
        normal = table.T @ (table * model.weights[:, None]) + precision
        size, k = np.sqrt(np.diag(normal)), len(self.free)
        covariance = np.linalg.inv(normal / np.outer(size, size)) / np.outer(size, size)
        middle = np.concatenate([model.at[self.free], self._linear[n:]])
        count = len(middle) if self.drawn else k
        return middle[:count], WIDER * np.linalg.cholesky(covariance[:count, :count])

    def density(self, at: Array, numbers: Array) -> float:
        """Log density of values and numbers, without the constants of normal distributions."""
        geometry, model = self.geometry, self.model
        if np.any(at < model.prior.lowest) or np.any(at > model.prior.highest):
            return IMPOSSIBLE
        residual = self._residual(at)
        if not np.isfinite(residual).all():
            return IMPOSSIBLE
        known = model.prior.near(at).density - 0.5 * float(numbers @ numbers)
        white = geometry.whitened(residual, model.noise)
        if self.drawn:
            return known + geometry.likelihood(white + self.columns @ numbers, model.noise)
        gone = np.linalg.solve(self._inner, self.columns.T @ white)
        size = float(np.sum(np.log(np.diag(self._inner))))
        return known + geometry.likelihood(white, model.noise) + 0.5 * float(gone @ gone) - size

    def _residual(self, at: Array) -> Array:
        """Rows of the model at some coordinates, without the slopes of `Evidence.evaluated`."""
        setting, geometry = self.model.setting, self.geometry
        there = replace(setting, values={**setting.values, **self.model.prior.values(at)})
        if isinstance(geometry, StoresGeometry):
            return geometry.simulated(there)[0]
        assert isinstance(geometry, Geometry)
        return geometry.rows.errors(geometry.rows.system.flows(there))[0][geometry.seen]

    def weight(self, share: Array) -> float:
        """Log density at a place of the unit cube, over that with which it is drawn:
        Student's in each independent direction."""
        middle, factor = self.about
        far = stdtrit(FREEDOM, share)
        drawn = len(far) * float(peak_of(np.array(FREEDOM)) - 0.5 * np.log(2.0 * np.pi))
        drawn -= 0.5 * (FREEDOM + 1.0) * float(np.sum(np.log1p(far**2 / FREEDOM)))
        drawn -= float(np.sum(np.log(np.diag(factor))))
        there, at = middle + factor @ far, self.model.at.copy()
        at[self.free] = there[: len(self.free)]
        density = self.density(at, there[len(self.free) :])
        return density - drawn - 0.5 * len(far) * float(np.log(2.0 * np.pi))

    def sampled(self, live: int, seed: int = 1) -> tuple[float, float]:
        """Log of the integral by nested sampling, and its standard uncertainty, nats."""
        sampler = NestedSampler(
            self.weight,
            lambda share: share,
            len(self.about[0]),
            nlive=live,
            bound="multi",
            sample="unif",
            bootstrap=0,
            first_update={"min_ncall": 2 * live, "min_eff": 70.0},
            rstate=np.random.default_rng(seed),
        )
        sampler.run_nested(dlogz=0.1, maxcall=MOST, print_progress=False)
        found, model = sampler.results, self.model
        odds = model.sizes.odds + self.geometry.noise_odds(model.noise)
        return float(found.logz[-1]) + odds, float(found.logzerr[-1])
