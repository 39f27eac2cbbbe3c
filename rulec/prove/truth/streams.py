"""Random numbers of their own for every purpose."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, purpose: str) -> np.random.Generator:
    """A generator for one purpose: what is added elsewhere changes nothing here."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])
