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


def copied(values: np.ndarray) -> np.ndarray:
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
        spooled = tempfile.SpooledTemporaryFile(limits.IN_MEMORY, prefix="rulec-")  # noqa: SIM115
        self._file = spooled
        self._size = 0
        self._joined: Array | None = None

    def append(self, part: np.ndarray) -> None:
        """Append numbers. Raises `Refusal` if the disk has no room for them."""
        data = np.asarray(part, dtype=float).tobytes()
        self._size += len(data)
        try:
            self._file.write(data)
        except OSError as error:
            raise _no_room(self._size, error) from None

    def joined(self) -> Array:
        """All numbers, shape (n,)."""
        if self._joined is None:
            try:
                self._file.seek(0)  # whatever is not written yet is written now
            except OSError as error:
                raise _no_room(self._size, error) from None
            with self._file as file:
                small = self._size <= limits.IN_MEMORY
                content = bytearray(file.read()) if small else mmap.mmap(file.fileno(), self._size)
            self._joined = np.frombuffer(content, float)
        return self._joined
