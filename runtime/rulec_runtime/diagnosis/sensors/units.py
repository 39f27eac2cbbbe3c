"""Units that a column could be in instead of that of its header."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec, UnitSpec
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.dead import at_zero
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.stationary import systematic_u

SECOND, HOUR = 1.0, 3600.0
"""Meters count per second, minute or hour."""


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
    """Other units that the numbers of a column, read with a scale (factor, offset), may be in."""
    own = parse_unit(signal.unit, units)
    if own is None or not any(own.dimension):
        return []
    factor, offset = scale
    spellings = _spellings(own, units, "/" in signal.unit)
    written = _name(signal, scale, spellings)
    found: dict[tuple[float, float], Mixup] = {}
    # Relatives of the stated unit first: mbar for bar, not hPa.
    for name in sorted(spellings, key=lambda n: (signal.unit not in n, len(n), n)):
        unit = spellings[name]
        ratio = unit.factor / factor
        shift = unit.offset - ratio * offset
        far = max(ratio, 1.0 / ratio) > limits.NEAR_UNITS or (ratio == 1.0 and shift != 0.0)
        if far:
            found.setdefault((ratio, shift), Mixup(written, name, ratio, shift))
    return list(found.values())


def exchangeable(
    signals: Sequence[SignalSpec], units: Mapping[str, UnitSpec]
) -> Iterator[tuple[SignalSpec, SignalSpec]]:
    """Pairs of columns that may have been swapped: readings of one dimension."""
    group = {s.id: i for i, same in enumerate(of_one_dimension(signals, units)) for s in same}
    for one, other in combinations((s for s in signals if s.id in group), 2):
        if group[one.id] == group[other.id]:
            yield one, other


def of_one_dimension(
    signals: Sequence[SignalSpec], units: Mapping[str, UnitSpec]
) -> list[list[SignalSpec]]:
    """The same in groups, in which any two may have been swapped."""
    found: dict[tuple[float, ...], list[SignalSpec]] = {}
    for signal in signals:
        unit = parse_unit(signal.unit, units)
        if unit is not None:
            found.setdefault(unit.dimension, []).append(signal)
    return [*found.values()]


def like_a_reading(signal: SignalSpec, values: Array, noise: float) -> bool:
    """Whether noise and value are plausible for a sensor of its class.

    `values`, shape (n,), SI, are read differently than recorded, and so is their `noise`. A column
    that is at zero all the time is in another unit: there any estimates agree.
    """
    if not np.isfinite(values).any():
        return False
    if at_zero(signal, values[np.isfinite(values)]).all():
        return False
    usual = float(np.nanmedian(values))
    u = float(np.nanmedian(systematic_u(signal, values) + np.zeros(len(values))))
    low, high = signal.lowest, signal.highest
    if low is not None and high is not None and not low <= usual <= high:
        return False
    return noise <= max(limits.NOISY_READING * u, limits.NOISY_SHARE * abs(usual - signal.offset))


def _spellings(own: UnitSpec, units: Mapping[str, UnitSpec], per_time: bool) -> dict[str, UnitSpec]:
    """Units of the same dimension: single ones, and quotients by a time."""
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


def _name(signal: SignalSpec, scale: tuple[float, float], spellings: Mapping[str, UnitSpec]) -> str:
    if scale == (signal.factor, signal.offset):
        return signal.unit
    names = [n for n, u in spellings.items() if (u.factor, u.offset) == scale]
    # mbar and hPa are the same: the header may state either.
    return " or ".join(sorted(names, key=len)[:2]) or signal.unit
