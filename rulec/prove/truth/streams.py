"""Random numbers of their own for every purpose."""

from __future__ import annotations

import zlib

import numpy as np

FURTHER = 1_000_003
"""Added to the seed of a case for each further plant that is drawn."""


def stream(seed: int, purpose: str) -> np.random.Generator:
    """A generator for one purpose: what is added elsewhere changes nothing here."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])
