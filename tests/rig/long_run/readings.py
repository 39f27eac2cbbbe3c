"""What goes wrong with columns of a recording; each function returns new columns."""

from collections.abc import Callable, Mapping

import numpy as np
from rulec_runtime.contract.plan import Array

Columns = Mapping[str, Array]


def title(columns: Columns, signal: str) -> str:
    """The header of a signal: `A.dp [bar]` of `A.dp`."""
    return next(name for name in columns if name.startswith(f"{signal} ["))


def changed(columns: Columns, signal: str, change: Callable[[Array], Array]) -> Columns:
    """Other values for a signal, in the unit shown."""
    name = title(columns, signal)
    return {**columns, name: change(columns[name])}


def absent(columns: Columns, signal: str) -> Columns:
    return {name: v for name, v in columns.items() if name != title(columns, signal)}


def held(columns: Columns, signal: str, first: int, value: float | None = None) -> Columns:
    """One value from a row on: that of the row, or a given one (NaN is an empty cell)."""
    return changed(
        columns,
        signal,
        lambda v: np.where(np.arange(v.size) < first, v, v[first] if value is None else value),
    )


def clipped(columns: Columns, signal: str, share: float) -> Columns:
    """Cut off at the value that this share of the readings does not reach."""
    return changed(columns, signal, lambda v: np.minimum(v, np.quantile(v, share)))


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


def spikes(values: Array, share: float, random: np.random.Generator) -> Array:
    """Half or twice the value here and there."""
    hit = random.uniform(size=values.size) < share
    return values * np.where(hit, random.choice([0.5, 2.0], values.size), 1.0)


def gaps(values: Array, share: float, random: np.random.Generator) -> Array:
    """Empty cells here and there."""
    return np.where(random.uniform(size=values.size) < share, np.nan, values)
