"""Points of long recordings, judged in batches: tables of all of them may lie in a file."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar, cast

import numpy as np

from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.recordings.larger_than_memory import arrays, let_go

Tables = TypeVar("Tables")
"""A frozen dataclass of tables."""

FIRST, SECOND, THIRD = ({"along": axis} for axis in range(3))
"""Marks of a field that is a table: the axis of the points."""


def points_along(kind: type) -> dict[str, int]:
    """The axis of the points in each table of a dataclass."""
    return {f.name: f.metadata["along"] for f in fields(kind) if "along" in f.metadata}


def batches(count: int) -> Iterator[slice]:
    """Slices of so many points, a batch each; one empty batch of none."""
    for low in range(0, max(count, 1), limits.POINTS_AT_ONCE):
        yield slice(low, min(low + limits.POINTS_AT_ONCE, count))


def in_batches(count: int, axis: Mapping[str, int], of_batch: Callable[[slice], Tables]) -> Tables:
    """The results for all points, joined from those of each batch.

    `axis` gives the axis of the points per table; other fields are those of the first batch.
    """
    if count <= limits.POINTS_AT_ONCE:
        return of_batch(slice(0, count))
    tables: dict[str, np.ndarray] = {}
    first = None
    for part in batches(count):
        here = of_batch(part)
        if first is None:
            first = here
            names = [f.name for f in fields(cast(Any, here)) if f.name in axis]
            samples = (np.moveaxis(getattr(here, name), axis[name], 0) for name in names)
            room = arrays([((count, *one.shape[1:]), one.dtype) for one in samples])
            tables = dict(zip(names, room, strict=True))
        for name, table in tables.items():
            table[part] = np.moveaxis(getattr(here, name), axis[name], 0)
        let_go(*tables.values())
    assert first is not None
    changed: dict[str, Any] = {n: np.moveaxis(table, 0, axis[n]) for n, table in tables.items()}
    return cast(Tables, replace(cast(Any, first), **changed))


def part_of(tables: Tables, axis: Mapping[str, int], part: slice, count: int) -> Tables:
    """Tables of some of so many points; points are last in memory, as tables are made."""
    if part.start == 0 and part.stop == count:
        return tables
    changed: dict[str, Any] = {}
    for name, at in axis.items():
        table = np.moveaxis(getattr(tables, name), at, -1)[..., part]
        changed[name] = np.moveaxis(np.ascontiguousarray(table), -1, at)
        let_go(table)
    return cast(Tables, replace(cast(Any, tables), **changed))


def of_points(table: np.ndarray, places: tuple[np.ndarray, ...], points: np.ndarray) -> np.ndarray:
    """``table[np.ix_(*places, points)]``, a few points at a time."""
    found = np.empty((*map(len, places), len(points)), dtype=table.dtype)
    for low in range(0, len(points), limits.GATHERED_AT_ONCE):
        part = slice(low, low + limits.GATHERED_AT_ONCE)
        found[..., part] = table[np.ix_(*places, points[part])]
        let_go(table)
    return found
