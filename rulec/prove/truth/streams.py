"""Independent random numbers for every purpose."""

from __future__ import annotations

import zlib

import numpy as np

FURTHER = 1_000_003
"""Added to the seed of a case for each further plant that is drawn."""


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Return a generator for one purpose, which no addition elsewhere changes."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])
