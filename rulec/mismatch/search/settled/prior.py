"""What is known of all values before the recording, of amplitudes and shapes of effects too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec.effects.candidate import TIME, Unknown
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Prior, prior_of
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.settled.sizes import log_inside


def prior_with_sizes(geometry: Geometry, setting: Configuration) -> Prior:
    """What is known of the values: those of the plant, amplitudes of effects, their shapes."""
    rows = geometry.rows
    own = {u.id: (c, u) for c in setting.joined for u in c.unknowns}
    plain = prior_of(rows.system, setting)
    mean, known, freedom = plain.mean.copy(), plain.known.copy(), plain.freedom.copy()
    odds = 0.0
    for i, name in enumerate(plain.names):
        stem = name.partition("#")[0]
        if stem not in own:
            continue
        candidate, unknown = own[stem]
        if unknown.null is not None:
            size = geometry.size(candidate, unknown)
            off = setting.values[name] - unknown.null
            freedom[i] = size.freedom
            if np.isfinite(size.width):
                mean[i] = unknown.null + np.copysign(size.usual, off)
                known[i] = size.width**-2
                odds -= log_inside(size, unknown)
            else:
                mean[i], known[i] = unknown.null, size.scale**-2
        else:
            mean[i], width = _range_of(rows, unknown, setting.values[name])
            known[i] = 12.0 / width**2
    return replace(plain, mean=mean, known=known, freedom=freedom, odds=odds)


def known_of(prior: Prior, setting: Configuration) -> dict[str, tuple[float, float, float]]:
    """Mean, scale and degrees of freedom of unknowns, as far as they are known before."""
    unknowns = set(setting.free_unknowns())
    each = zip(prior.names, prior.mean, prior.known, prior.freedom, strict=True)
    return {n: (float(m), float(k**-0.5), float(f)) for n, m, k, f in each if n in unknowns and k}


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
