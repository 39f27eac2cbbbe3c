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
from typing import IO, Any

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings import limits


def array(shape: tuple[int, ...] | int, kind: Any = float) -> np.ndarray:
    """An array of zeros. Raises `Refusal` if the disk has no room for it."""
    size = prod(shape if isinstance(shape, tuple) else (shape,)) * np.dtype(kind).itemsize
    if size <= limits.IN_MEMORY:
        return np.zeros(shape, kind)
    try:
        with tempfile.TemporaryFile(prefix="rulec-") as file:
            # Reserved now: a disk that fills up later would kill the process without a message.
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
            return np.frombuffer(mmap.mmap(file.fileno(), size), kind).reshape(shape)
    except OSError as error:
        raise _no_room(size, error) from None


def _no_room(size: int, error: OSError) -> Refusal:
    return Refusal(
        f"{tempfile.gettempdir()}: no room for {size / 1e9:.1f} GB of readings "
        f"({error.strerror}); name a folder on a larger disk in TMPDIR"
    )


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
    return np.concatenate(parts, out=found)


class Growing:
    """Numbers that come in parts, until they are joined."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._waiting = self._written = 0
        self._file: IO[bytes] | None = None
        self._mapped: Array | None = None

    def append(self, part: np.ndarray) -> None:
        """Append numbers. Raises `Refusal` if the disk has no room for them."""
        self._parts.append(np.asarray(part, dtype=float))
        self._waiting += self._parts[-1].nbytes
        if self._waiting > limits.IN_MEMORY:
            self._write()

    def _write(self) -> None:
        try:
            self._file = self._file or tempfile.TemporaryFile(prefix="rulec-")  # noqa: SIM115
            for part in self._parts:
                self._file.write(part.tobytes())
            self._file.flush()
        except OSError as error:
            raise _no_room(self._written + self._waiting, error) from None
        self._parts, self._written, self._waiting = [], self._written + self._waiting, 0

    def joined(self) -> Array:
        """All numbers, shape (n,)."""
        if self._file is not None:
            self._write()
            with self._file as file:
                self._mapped = np.frombuffer(mmap.mmap(file.fileno(), self._written), float)
            self._file = None
        if self._mapped is not None:
            return self._mapped
        return np.concatenate(self._parts) if self._parts else np.zeros(0)
