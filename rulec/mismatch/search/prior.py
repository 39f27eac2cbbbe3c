"""The prior of all values, amplitudes and shapes of effects included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Prior
from rulec.mismatch.search.sizes import Size, log_inside


def prior_with_sizes(
    plain: Prior,
    setting: Configuration,
    size_of: Callable[[Candidate, Unknown], Size],
    range_of: Callable[[Unknown, float], tuple[float, float]],
) -> Prior:
    """Add the amplitudes and shapes of effects to the prior of the plant.

    `size_of` gives the prior of an amplitude, `range_of` the middle and width of the range of a
    shape, by its starting value.
    """
    own = {u.id: (c, u) for c in setting.joined for u in c.unknowns}
    mean, known, freedom = plain.mean.copy(), plain.known.copy(), plain.freedom.copy()
    odds = 0.0
    for i, name in enumerate(plain.names):
        stem = name.partition("#")[0]
        if stem not in own:
            continue
        candidate, unknown = own[stem]
        if unknown.null is not None:
            size = size_of(candidate, unknown)
            off = setting.values[name] - unknown.null
            freedom[i] = size.freedom
            if np.isfinite(size.width):
                mean[i] = unknown.null + np.copysign(size.usual, off)
                known[i] = size.width**-2
                odds -= log_inside(size, unknown)
            else:
                mean[i], known[i] = unknown.null, size.scale**-2
        else:
            mean[i], width = range_of(unknown, setting.values[name])
            known[i] = 12.0 / width**2
    return replace(plain, mean=mean, known=known, freedom=freedom, odds=odds)


def known_of(prior: Prior, setting: Configuration) -> dict[str, tuple[float, float, float]]:
    """Mean, scale and degrees of freedom of those unknowns that have a prior."""
    unknowns = set(setting.free_unknowns())
    each = zip(prior.names, prior.mean, prior.known, prior.freedom, strict=True)
    return {n: (float(m), float(k**-0.5), float(f)) for n, m, k, f in each if n in unknowns and k}


def range_over(unknown: Unknown, start: float, driver: Array | None) -> tuple[float, float]:
    """Middle and width of the range of a shape, by the readings of its driver."""
    if driver is not None:
        low, high = np.nanquantile(driver, [0.02, 0.98])
        return float(low + high) / 2, max(float(high - low), 1e-12)
    if unknown.offset:
        # The zero of its unit is arbitrary: only the stated range is known.
        return (unknown.lowest + unknown.highest) / 2, unknown.highest - unknown.lowest
    width = 2.0 * max((abs(s) for s in unknown.starts), default=abs(start)) or 1.0
    return float(np.sign(start) or 1.0) * width / 2, width
