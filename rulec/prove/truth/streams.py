"""Independent random numbers for every purpose."""

import zlib
from statistics import NormalDist

import numpy as np

FURTHER = 1_000_003
"""Added to the seed of a case for each further plant that is drawn."""


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Return a generator for one purpose, which no addition elsewhere changes."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


WITHIN = 2.0
"""Standard uncertainties; a part further off fails the maker's final inspection."""


def truncated(share: float) -> float:
    """Return a standard normal deviation truncated at WITHIN, by its share from 0 to 1.

    Source: inverse transform sampling.
    """
    normal = NormalDist()
    outside = normal.cdf(-WITHIN)
    return normal.inv_cdf(outside + share * (1.0 - 2.0 * outside))


def factor(u: float, random: np.random.Generator) -> float:
    """Draw 1 plus a truncated normal deviation of standard deviation `u`."""
    return 1.0 + u * truncated(random.uniform())
