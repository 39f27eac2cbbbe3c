"""What is known of all values before the recording, with the tails that it has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Unknown
from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import prior_of
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search import limits
from rulec.mismatch.search.settled.geometry import Geometry


class Prior:
    """What is known of the values: those of the plant, amplitudes of effects, their shapes."""

    def __init__(self, geometry: Geometry, setting: Configuration) -> None:
        rows = geometry.rows
        own = {u.id: (c, u) for c in setting.joined for u in c.unknowns}
        plain = prior_of(rows.system, setting)
        mean, precision = plain.mean.copy(), plain.precision.copy()
        stems = [name.partition("#")[0] for name in plain.names]
        self.effect = np.array([stem in own for stem in stems])
        self.amplitude = np.zeros(len(stems), dtype=bool)
        self.freedom = np.ones(len(stems))
        self.peak = 0.0
        for i in np.flatnonzero(self.effect):
            candidate, unknown = own[stems[i]]
            if unknown.null is not None:
                size = geometry.size(candidate, unknown)
                mean[i], precision[i, i] = unknown.null, size.scale**-2
                self.amplitude[i], self.freedom[i] = True, size.freedom
                self.peak += size.peak
            else:
                mean[i], width = _range_of(rows, unknown, setting.values[plain.names[i]])
                precision[i, i] = 12.0 / width**2
        self.prior = replace(plain, mean=mean, precision=precision)
        ridge = np.diag(1e-12 / plain.size**2)
        self.stated = precision + ridge
        self._sensor = np.array([name.startswith(ERROR) for name in plain.names])
        self._plant = ~self.effect & ~self._sensor & (np.diag(precision) > 0)
        at = np.flatnonzero(self._plant)
        self._size = np.sqrt(np.diag(precision))[at]
        between = precision[np.ix_(at, at)] / np.outer(self._size, self._size)
        self._parts, self._ways = np.linalg.eigh(between)

    def density(self, at: Array) -> tuple[float, Array]:
        """Log density, less that of the normal one at its mean, and the precision it has there."""
        off = at - self.prior.mean
        precision = self.stated.copy()
        plant = np.flatnonzero(self._plant)
        far = np.sqrt(np.maximum(self._parts, 0.0)) * (self._ways.T @ (self._size * off[plant]))
        tails = -0.5 * (limits.STUDENT + 1.0) * float(np.sum(np.log1p(far**2 / limits.STUDENT)))
        weight = self._parts * (limits.STUDENT + 1.0) / (limits.STUDENT + far**2)
        outer = np.outer(self._size, self._size)
        precision[np.ix_(plant, plant)] = (self._ways * weight) @ self._ways.T * outer
        size = off**2 * np.diag(self.stated)
        wide = np.flatnonzero(self.amplitude)
        free = self.freedom[wide]
        tails -= 0.5 * float(np.sum((free + 1.0) * np.log1p(size[wide] / free)))
        precision[wide, wide] *= (free + 1.0) / (free + size[wide])
        rest = ~self._plant & ~self.amplitude
        return tails - 0.5 * float(np.sum(size[rest])), precision


def _range_of(rows: Rows, unknown: Unknown, start: float) -> tuple[float, float]:
    """Middle and width of the range in which a shape lies."""
    data = rows.system.data
    if unknown.driver is not None:
        values = data.clock if unknown.driver == TIME else data.values[unknown.driver]
        low, high = np.nanquantile(values, [0.02, 0.98])
        return float(low + high) / 2, max(float(high - low), 1e-12)
    if unknown.offset:
        # Zero is where somebody put it: the range that the entry states is all that is known.
        return (unknown.lowest + unknown.highest) / 2, unknown.highest - unknown.lowest
    width = 2.0 * max((abs(s) for s in unknown.starts), default=abs(start)) or 1.0
    return float(np.sign(start) or 1.0) * width / 2, width
