"""Read MAT files up to version 7: arrays, and structures of arrays, but no objects."""

import os
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import scipy.io
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, refuse_bomb
from rulec_runtime.recordings.readers.tree import Group, Leaf, tables
from rulec_runtime.recordings.table import Sheet

PIECE = 1 << 20
HEAD = 128
COMPRESSED = 15
OBJECTS = (MatlabObject, MatlabOpaque, MatlabFunction)
REMEDY = (
    "a timetable T is kept readable by S = table2struct(timetable2table(T), 'ToScalar', true); "
    "S.Time = seconds(S.Time - S.Time(1)); save('x.mat', '-struct', 'S', '-v7')"
)


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """Tables of a MAT file: its variables, and the fields of each structure."""
    _check(file, path)
    data = scipy.io.loadmat(file, chars_as_strings=True, squeeze_me=True)
    content = {k: v for k, v in data.items() if not k.startswith("__") and k}
    groups = list(_groups("", content, 0))
    found = tables(groups, times)
    # An opaque object of MATLAB may have no name.
    objects = [k for k, v in data.items() if isinstance(v, OBJECTS)]
    if objects and not any(group.leaves for group in groups):
        raise RecordingRefused(
            f"{path}: '{objects[0].strip('_')[:40] or 'what it holds'}' is an object of MATLAB, "
            f"which only MATLAB can read; {REMEDY}"
        )
    if not found:
        raise RecordingRefused(f"{path}: it holds no columns of numbers")
    return found


def _groups(name: str, content: Mapping[str, Any], depth: int) -> Iterator[Group]:
    """Variables or fields side by side, then those of structures among them."""
    series = {k: v.reshape(-1) for k, v in content.items() if _is_series(v)}
    yield Group(name, {k: Leaf(v.size, partial(np.asarray, v)) for k, v in series.items()})
    if depth >= limits.MOST_IN_TREE:
        return
    for key, value in content.items():
        inner = _fields(value)
        if inner is not None:
            yield from _groups(f"{name}/{key}".strip("/"), inner, depth + 1)


def _fields(value: Any) -> Mapping[str, Any] | None:
    """Fields of a structure; for an array of structures, one per row, columns of its fields."""
    if isinstance(value, OBJECTS) or not isinstance(value, np.ndarray | np.void):
        return None
    names = value.dtype.names
    if not names:
        return None
    found = {}
    for name in names:
        part = value[name]
        if value.ndim:  # a field of all rows, as numbers if each row has one
            try:
                part = np.array(part.tolist(), dtype=float)
            except (TypeError, ValueError):
                part = np.array([str(v) for v in part.ravel().tolist()])
        elif isinstance(part, np.ndarray) and part.dtype == object and part.ndim == 0:
            part = np.asarray(part[()])
        found[name] = part
    return found


def _is_series(value: Any) -> bool:
    """Whether an array has one number or text per row, along one axis."""
    if isinstance(value, OBJECTS) or not isinstance(value, np.ndarray):
        return False
    if value.dtype.kind == "O":
        return value.ndim == 1 and all(isinstance(v, str) for v in value.tolist())
    return value.ndim == 1 and value.dtype.kind in "biufU"


def _check(file: BinaryIO, path: Path) -> None:
    """Refuse a file whose parts unpack to far more than its size."""
    size, total = file.seek(0, os.SEEK_END), 0
    file.seek(HEAD - 2)
    order = "<" if file.read(2) == b"IM" else ">"
    while len(tag := file.read(8)) == 8:
        kind, count = struct.unpack(f"{order}II", tag)
        if kind != COMPRESSED:
            file.seek(count, os.SEEK_CUR)
            continue
        unpacker, packed = zlib.decompressobj(), file.read(count)
        while packed:
            total += len(unpacker.decompress(packed, PIECE))
            packed = unpacker.unconsumed_tail
            refuse_bomb(path, total, size)
    file.seek(0)
