"""Units that a column could be in instead of that of its header."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec, UnitSpec
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.stationary import systematic_u

SECOND, HOUR = 1.0, 3600.0
"""A meter counts by the second, the minute or the hour."""


@dataclass(frozen=True)
class Mixup:
    """Numbers in `true`, read as if in `written`: SI = SI as read * factor + offset."""

    written: str
    true: str
    factor: float
    offset: float


def mixups(
    signal: SignalSpec, scale: tuple[float, float], units: Mapping[str, UnitSpec]
) -> list[Mixup]:
    """What else the numbers of a column, read with a scale (factor, offset), may be."""
    own = parse_unit(signal.unit, units)
    if own is None or not any(own.dimension):
        return []
    factor, offset = scale
    known = _spellings(own, units, "/" in signal.unit)
    written = _name(signal, scale, known)
    found: dict[tuple[float, float], Mixup] = {}
    for name, unit in sorted(known.items(), key=lambda item: (len(item[0]), item[0])):
        ratio = unit.factor / factor
        shift = unit.offset - ratio * offset
        far = max(ratio, 1.0 / ratio) > limits.NEAR_UNITS or (ratio == 1.0 and shift != 0.0)
        if far:
            found.setdefault((ratio, shift), Mixup(written, name, ratio, shift))
    return list(found.values())


def exchangeable(
    signals: Sequence[SignalSpec], units: Mapping[str, UnitSpec]
) -> Iterator[tuple[SignalSpec, SignalSpec]]:
    """Pairs of columns that may stand in each other's place: readings of one dimension."""
    group = {s.id: i for i, same in enumerate(of_one_dimension(signals, units)) for s in same}
    for one, other in combinations((s for s in signals if s.id in group), 2):
        if group[one.id] == group[other.id]:
            yield one, other


def of_one_dimension(
    signals: Sequence[SignalSpec], units: Mapping[str, UnitSpec]
) -> list[list[SignalSpec]]:
    """The same in groups, all of which may stand in each other's place."""
    found: dict[tuple[float, ...], list[SignalSpec]] = {}
    for signal in signals:
        unit = parse_unit(signal.unit, units)
        if unit is not None:
            found.setdefault(unit.dimension, []).append(signal)
    return [*found.values()]


def like_a_reading(signal: SignalSpec, values: Array, noise: float) -> bool:
    """Is the noise that of a sensor of its class, and the value one it can show?

    `values`, shape (n,), SI, are read otherwise than recorded, and so is their `noise`.
    """
    if not np.isfinite(values).any():
        return False
    usual = float(np.nanmedian(values))
    u = float(np.nanmedian(systematic_u(signal, values) + np.zeros(len(values))))
    low, high = signal.lowest, signal.highest
    if low is not None and high is not None and not low <= usual <= high:
        return False
    return noise <= max(limits.NOISY_READING * u, limits.NOISY_SHARE * abs(usual - signal.offset))


def _spellings(own: UnitSpec, units: Mapping[str, UnitSpec], per_time: bool) -> dict[str, UnitSpec]:
    """Units of the same dimension: single ones, and one per time."""
    found = {name: u for name, u in units.items() if u.dimension == own.dimension}
    if not per_time:
        return found
    times = {
        n: u
        for n, u in units.items()
        if u.dimension == units["s"].dimension and SECOND <= u.factor <= HOUR
    }
    for (name, unit), (per, time) in product(units.items(), times.items()):
        pairs = zip(unit.dimension, time.dimension, strict=True)
        dimension = tuple(a - b for a, b in pairs)
        if dimension == own.dimension and any(unit.dimension) and not unit.offset:
            found[f"{name}/{per}"] = UnitSpec(unit.factor / time.factor, 0.0, dimension)
    return found


def _name(signal: SignalSpec, scale: tuple[float, float], known: Mapping[str, UnitSpec]) -> str:
    if scale == (signal.factor, signal.offset):
        return signal.unit
    names = [n for n, u in known.items() if (u.factor, u.offset) == scale]
    # mbar and hPa are one: the header may have said either.
    return " or ".join(sorted(names, key=len)[:2]) or signal.unit
