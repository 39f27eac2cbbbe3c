"""Read HDF5 files, and MAT files of version 7.3: groups of arrays, and arrays of records.

Links and data outside the file are not followed.
"""

import os
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, refuse_bomb
from rulec_runtime.recordings.readers.tree import Group, Leaf, tables
from rulec_runtime.recordings.table import Sheet

UNITS = ("units", "unit", "Units", "Unit", "unit_string")
"""Attributes that may hold the unit of an array."""

MATLAB = "MATLAB_class"
OPAQUE = "MATLAB_object_decode"


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """Tables of an HDF5 file: arrays of one length in a group, and arrays of records."""
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    source = h5py.File(file, "r")
    walk = _Walk(path, size)
    groups = list(walk.groups("", source, 0))
    found = tables(groups, times)
    if not found:
        raise RecordingRefused(f"{path}: it holds no columns of numbers{walk.hint()}")
    if walk.outside:
        text = f"'{walk.outside[0]}' leads out of the file and is not followed"
        found = [replace(sheet, remarks=(*sheet.remarks, text)) for sheet in found]
    return found


class _Walk:
    """Visits each group of a file once."""

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size = path, size
        self._visited: set[Any] = set()
        self._objects = 0
        self.outside: list[str] = []
        self._opaque: list[str] = []

    def hint(self) -> str:
        """Why there may be no columns."""
        if self.outside:
            return (
                f"; '{self.outside[0]}' leads out of the file and is not followed: copy what it "
                "leads to into the file"
            )
        if self._opaque:
            return (
                f"; '{self._opaque[0]}' is an object of MATLAB, which only MATLAB can read: "
                "write a timetable as a structure of columns (table2struct with ToScalar)"
            )
        return ""

    def groups(self, name: str, group: Any, depth: int) -> Iterator[Group]:
        """Arrays of a group, and those of the groups in it."""
        address = h5py.h5o.get_info(group.id).addr
        if address in self._visited or depth > limits.MOST_IN_TREE:
            return
        self._visited.add(address)
        leaves: dict[str, Leaf] = {}
        inner = []
        for key in group:
            self._count()
            full = f"{name}/{key}".strip("/")
            if key.startswith("#"):  # where MATLAB keeps data of its objects
                continue
            if not isinstance(group.get(key, getlink=True), h5py.HardLink):
                self.outside.append(full)
                continue
            item = group[key]
            if isinstance(item, h5py.Group):
                inner.append((full, item))
            elif isinstance(item, h5py.Dataset) and self._is_here(full, item):
                kind = item.dtype
                if kind.names:
                    fields = [n for n in kind.names if not kind[n].names and not kind[n].shape]
                    yield Group(full, {n: self._leaf(item, n) for n in fields})
                elif _is_series(item):
                    leaves[key] = self._leaf(item)
        yield Group(name, leaves)
        for full, item in inner:
            yield from self.groups(full, item, depth + 1)

    def _leaf(self, data: Any, column: str = "") -> Leaf:
        """An array of the file, or one field of its records."""
        keys = (f"{column}_{UNITS[0]}", f"{column}_{UNITS[1]}") if column else UNITS
        unit = next((data.attrs[key] for key in keys if key in data.attrs), "")
        unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)

        def load() -> Any:
            refuse_bomb(self._path, data.size * data.dtype.itemsize, self._size)
            values = np.asarray(data.fields(column)[()] if column else data[()]).reshape(-1)
            if h5py.check_string_dtype(values.dtype) is None:
                return values
            return np.array([v.decode("utf-8", "replace") for v in values.tolist()], dtype=object)

        return Leaf(int(data.size), load, unit)

    def _is_here(self, name: str, data: Any) -> bool:
        """Whether the values of an array are in this file."""
        if data.attrs.get(OPAQUE) is not None:
            self._opaque.append(name)
            return False
        if data.external or data.is_virtual:
            self.outside.append(name)
            return False
        return True

    def _count(self) -> None:
        self._objects += 1
        if self._objects > limits.MOST_OBJECTS:
            raise RecordingRefused(
                f"{self._path}: it holds more than {limits.MOST_OBJECTS} arrays and groups, as no "
                "recording does; copy the recording's group into a file of its own"
            )


def _is_series(data: Any) -> bool:
    """Whether an array has one number or text per row, along one axis (MATLAB: row or column)."""
    if data.shape is None or max(data.shape, default=0) != data.size or data.size < 2:
        return False
    if data.attrs.get(MATLAB, b"") in (b"char", b"cell", b"function_handle"):
        return False
    return data.dtype.kind in "biuf" or h5py.check_string_dtype(data.dtype) is not None
