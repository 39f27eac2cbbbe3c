"""Samples of a recording, and the use of each block of them.

Samples are split by blocks of time, never singly: neighbours are correlated, so a sample between
two others tests nothing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

ESTIMATION, SELECTION, HELDOUT = 0, 1, 2

PATTERN = (ESTIMATION, SELECTION, HELDOUT, SELECTION, ESTIMATION)
"""Use of the blocks of a recording, in turn."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Samples in order of time.

    `time`, s, and `part`, one of the numbers above, have shape (n,). `split` describes the split in
    words, `digest` is its hash. `timed` samples have a common clock; otherwise nothing can follow
    time.
    """

    time: Array
    part: NDArray[np.intp]
    split: str
    digest: str
    timed: bool = True

    @property
    def open(self) -> np.ndarray:
        """Flags of samples that are not held out, shape (n,)."""
        return np.asarray(self.part != HELDOUT)


def digest_of(time: Array, part: NDArray[np.intp]) -> str:
    """Hash of a split; `time`, s, and `part` have shape (n,)."""
    data = np.ascontiguousarray(time).tobytes() + part.astype("i1").tobytes()
    return hashlib.sha256(data).hexdigest()[:16]


def inside_of(time: Array, spans: Sequence[tuple[float, float]]) -> np.ndarray:
    """Flags of samples within some spans of time, s, ends included, shape (n,)."""
    inside: np.ndarray = np.zeros(len(time), dtype=bool)
    for low, high in spans:
        inside |= (time >= low) & (time <= high)
    return inside
