"""What goes wrong with columns of a recording; each function returns new columns."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rulec_runtime.contract.plan import Array

Columns = Mapping[str, Array]


def title(columns: Columns, signal: str) -> str:
    """The header of a signal: `A.dp [bar]` of `A.dp`."""
    return next(name for name in columns if name.startswith(f"{signal} ["))


def put(columns: Columns, signal: str, values: Array) -> Columns:
    """Another column for a signal."""
    return {**columns, title(columns, signal): values}


def absent(columns: Columns, signal: str) -> Columns:
    """No such column."""
    return {name: v for name, v in columns.items() if name != title(columns, signal)}


def lost(columns: Columns, signal: str, first: int = 0) -> Columns:
    """Empty cells from a row on."""
    values = columns[title(columns, signal)].copy()
    values[first:] = np.nan
    return put(columns, signal, values)


def gaps(columns: Columns, signal: str, share: float, random: np.random.Generator) -> Columns:
    """Empty cells here and there."""
    values = columns[title(columns, signal)]
    return put(columns, signal, np.where(random.uniform(size=values.size) < share, np.nan, values))


def frozen(columns: Columns, signal: str, first: int) -> Columns:
    """The same value from a row on."""
    values = columns[title(columns, signal)].copy()
    values[first:] = values[first]
    return put(columns, signal, values)


def dead(columns: Columns, signal: str, first: int) -> Columns:
    """Zero from a row on."""
    values = columns[title(columns, signal)].copy()
    values[first:] = 0.0
    return put(columns, signal, values)


def clipped(columns: Columns, signal: str, share: float) -> Columns:
    """Cut off at the value that this share of the readings does not reach."""
    values = columns[title(columns, signal)]
    return put(columns, signal, np.minimum(values, np.quantile(values, share)))


def scaled(columns: Columns, signal: str, factor: Array | float) -> Columns:
    """Times a factor, or a course of it."""
    return put(columns, signal, columns[title(columns, signal)] * factor)


def offset(columns: Columns, signal: str, by: Array | float) -> Columns:
    """Plus a value, or a course of it, in the unit shown."""
    return put(columns, signal, columns[title(columns, signal)] + by)


def swapped(columns: Columns, one: str, other: str) -> Columns:
    """Two columns under each other's header."""
    a, b = title(columns, one), title(columns, other)
    return {**columns, a: columns[b], b: columns[a]}


def all_in(columns: Columns, signal: str, factor: float) -> Columns:
    """All columns of a signal, of every module, in another unit than the header says."""
    return {
        name: v * factor if name.split(" [")[0].endswith(f".{signal}") else v
        for name, v in columns.items()
    }


def spikes(columns: Columns, signal: str, share: float, random: np.random.Generator) -> Columns:
    """Half or twice the value here and there."""
    values = columns[title(columns, signal)]
    hit = random.uniform(size=values.size) < share
    return put(columns, signal, values * np.where(hit, random.choice([0.5, 2.0], values.size), 1.0))


def late(columns: Columns, signal: str, rows: int) -> Columns:
    """What was there some rows ago."""
    values = columns[title(columns, signal)]
    return put(columns, signal, np.concatenate([np.full(rows, values[0]), values[:-rows]]))
