"""Arrays that may be larger than memory.

Small arrays stay in memory. Large ones are mapped from an unnamed file in the folder for temporary
files (``TMPDIR``): columns of readings, and tables of all operating points. Where memory is short,
the system writes their pages to the file and reads them again, so no pass over them needs care.
"""

import mmap
import os
import tempfile
from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings import limits

Spec = tuple[tuple[int, ...], Any]
"""Shape and dtype of an array."""


def arrays(specs: Sequence[Spec]) -> list[np.ndarray]:
    """Arrays of zeros, in memory if they are small together.

    Raises `Refusal` if the disk has no room for them.
    """
    sizes = [prod(shape) * np.dtype(kind).itemsize for shape, kind in specs]
    if sum(sizes) <= limits.IN_MEMORY:
        return [np.zeros(shape, kind) for shape, kind in specs]
    rounded = [-(-size // limits.ALIGNED) * limits.ALIGNED for size in sizes]
    places = np.cumsum([0, *rounded]).tolist()
    room = _room(max(places[-1], limits.ALIGNED))
    return [
        np.frombuffer(room, kind, prod(shape), place).reshape(shape)
        for (shape, kind), place in zip(specs, places[:-1], strict=True)
    ]


def array(shape: tuple[int, ...] | int, kind: Any = float) -> np.ndarray:
    """One array of zeros."""
    return arrays([(shape if isinstance(shape, tuple) else (shape,), kind)])[0]


def _room(size: int) -> mmap.mmap:
    try:
        with tempfile.TemporaryFile(prefix="rulec-") as file:
            # Reserved now: a disk that fills up later would kill the process without a message.
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
            return mmap.mmap(file.fileno(), size)
    except OSError as error:
        raise Refusal(
            f"{tempfile.gettempdir()}: no room for {size / 1e9:.1f} GB of readings "
            f"({error.strerror}); name a folder on a larger disk in TMPDIR"
        ) from None


def kept(values: np.ndarray) -> np.ndarray:
    """A copy, in a file if it is large."""
    found = array(len(values), values.dtype)
    found[:] = values
    return found


def one_behind_the_other(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Join at least one array."""
    if len(parts) == 1:
        return parts[0]
    found = array(sum(map(len, parts)), np.result_type(*parts))
    np.concatenate(parts, out=found)
    return found


class Growing:
    """Numbers that come in parts, at most `most` if that is known.

    `beside` is how many such arrays grow at the same time.
    """

    def __init__(self, most: int | None = None, beside: int = 1) -> None:
        self._parts: list[np.ndarray] = []
        self._count = 0
        size = 0 if most is None else most * np.dtype(float).itemsize
        self._room = None
        if most is not None and size * beside > limits.IN_MEMORY:
            self._room = np.frombuffer(_room(max(size, limits.ALIGNED)), float)

    def __len__(self) -> int:
        return self._count

    def append(self, part: np.ndarray) -> None:
        """Append numbers."""
        if self._room is None:
            self._parts.append(part)
        else:
            self._room[self._count : self._count + len(part)] = part
        self._count += len(part)

    def joined(self) -> Array:
        """All numbers, shape (n,)."""
        if self._room is not None:
            return self._room[: self._count]
        return np.concatenate(self._parts) if self._parts else np.zeros(0)
