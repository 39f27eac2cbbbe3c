"""Points of long recordings, judged in batches: tables of all of them may lie in a file."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.recordings.larger_than_memory import array

FIRST, SECOND, THIRD = ({"along": axis} for axis in range(3))
"""Marks of a field that is a table: the axis of the points."""


def points_along(kind: type) -> dict[str, int]:
    """The axis of the points in each table of a dataclass."""
    return {f.name: f.metadata["along"] for f in fields(kind) if "along" in f.metadata}


def batches(count: int, most: int = limits.POINTS_AT_ONCE) -> Iterator[slice]:
    """Slices of so many points, at most `most` each; one empty batch of none."""
    for low in range(0, max(count, 1), most):
        yield slice(low, min(low + most, count))


def in_batches(
    count: int,
    axes: Sequence[Mapping[str, int]],
    of_batch: Callable[[slice], Sequence[Any]],
    most: int = limits.POINTS_AT_ONCE,
) -> Sequence[Any]:
    """Frozen dataclasses of tables for all points, joined from those of each batch.

    `axes` give, for each of them, the axis of the points per table; other fields are those of the
    first batch.
    """
    if count <= most:
        return of_batch(slice(0, count))
    first: Sequence[Any] = ()
    room: list[np.ndarray] = []
    for part in batches(count, most):
        here = of_batch(part)
        own = [
            np.moveaxis(getattr(one, name), at, 0)
            for one, axis in zip(here, axes, strict=True)
            for name, at in axis.items()
        ]
        if not room:
            first, room = here, [array((count, *one.shape[1:]), one.dtype) for one in own]
        for table, one in zip(room, own, strict=True):
            table[part] = one
    left = iter(room)
    return [
        replace(one, **{name: np.moveaxis(next(left), 0, at) for name, at in axis.items()})
        for one, axis in zip(first, axes, strict=True)
    ]
