"""Samples of a recording, and what each block of them serves for.

Samples are split by blocks of time, never singly: neighbours are alike, and a sample between two
others is no test of anything.
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
"""What the blocks of a recording serve for, in turn."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Samples in order of time.

    `time` in s and `part`, one of the numbers above, have shape (n,). `split` says in words which
    blocks served for what, `digest` is its hash. `timed` tells that samples lie on one clock: else
    nothing can follow time.
    """

    time: Array
    part: NDArray[np.intp]
    split: str
    digest: str
    timed: bool = True

    @property
    def open(self) -> np.ndarray:
        """Samples that may be looked at before the end, shape (n,)."""
        flags: np.ndarray = self.part != HELDOUT
        return flags


def digest_of(time: Array, part: NDArray[np.intp]) -> str:
    """Hash of a split; `time`, s, and `part` have shape (n,)."""
    data = np.ascontiguousarray(time).tobytes() + part.astype("i1").tobytes()
    return hashlib.sha256(data).hexdigest()[:16]


def inside_of(time: Array, spans: Sequence[tuple[float, float]]) -> np.ndarray:
    """Samples within some spans of time, s, ends included, shape (n,)."""
    inside: np.ndarray = np.zeros(len(time), dtype=bool)
    for low, high in spans:
        inside |= (time >= low) & (time <= high)
    return inside
