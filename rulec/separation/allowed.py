"""How far, how fast and for how long an operator may change the inputs of a plant."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec

from rulec.separation import limits
from rulec.study.points import range_of


@dataclass(frozen=True, kw_only=True)
class Range:
    """The allowed change of an input: between two values as its sensor shows them, at most `rate`
    per second, for at least `hold` seconds; and whether it costs product."""

    signal: SignalSpec
    lowest: float
    highest: float
    rate: float = math.inf
    hold: float = limits.STEP_SECONDS
    costs: bool = False

    def levels(self, count: int) -> Array:
        """Values spread over the range, as its sensor shows them, that are easy to set."""
        if not self.highest > self.lowest:
            return np.zeros(0)
        unit, first, last = self._ticks
        shown = self._nearest(unit * np.unique(np.round(np.linspace(first, last, count))))
        return shown[(shown >= self.lowest) & (shown <= self.highest)]

    def easy(self, values: Array) -> Array:
        """The nearest values in the range that are easy to set, shape (n,), SI."""
        shown = self._nearest((values - self.signal.offset) / self.signal.factor)
        return shown * self.signal.factor + self.signal.offset

    @property
    def _ticks(self) -> tuple[float, int, int]:
        """A power of ten, and the first and last of its multiples in the range."""
        span = self.highest - self.lowest
        unit = 10.0 ** math.floor(math.log10(span / limits.STEPS_OF_A_RANGE))
        return unit, math.ceil(self.lowest / unit), math.floor(self.highest / unit)

    def _nearest(self, shown: Array) -> Array:
        """Multiples of that power as decimal numbers, 0.3 and not 0.30000000000000004."""
        unit, first, last = self._ticks
        digits = max(0, -round(math.log10(unit)))
        ticks = np.clip(np.round(shown / unit), first, last)
        return np.array([round(tick * unit, digits) for tick in ticks.tolist()])

    def si(self, shown: float) -> float:
        """A value that the sensor shows, SI."""
        return shown * self.signal.factor + self.signal.offset


@dataclass(frozen=True)
class Allowed:
    """Inputs that may be changed, modules for which a change of flow costs product, and bounds of
    readings, SI."""

    inputs: Mapping[str, Range]
    costly: frozenset[str] = field(default_factory=frozenset)
    readings: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def allowed_of(ruleset: Ruleset, given: Allowed | None = None) -> Allowed:
    """Ranges of the inputs, by their sensors, the calibration and the `given` limits.

    With given limits, inputs that they do not name stay constant. Without, an input that was not
    calibrated stays near its reference.
    """
    named, inputs = {} if given is None else given.inputs, {}
    for signal in (ruleset.signal_by_id[name] for name in ruleset.simulation.given):
        part = named.get(signal.id)
        if not signal.is_input or (given is not None and part is None):
            continue
        low, high = signal.ends
        calibrated = signal.valid_from is not None and signal.valid_to is not None
        if calibrated or part is None:
            own = range_of(signal)
            low, high = max(low, own[0]), min(high, own[1])
        elif signal.minimum is not None:
            low = max(low, signal.minimum)
        if not high > low:
            continue
        # A negative factor would swap the ends.
        lowest, highest = sorted((signal.shown(low), signal.shown(high)))
        part = part or Range(signal=signal, lowest=lowest, highest=highest)
        lowest, highest = max(lowest, part.lowest), min(highest, part.highest)
        hold = max(part.hold, limits.STEP_SECONDS)
        if highest > lowest:
            inputs[signal.id] = replace(part, lowest=lowest, highest=highest, hold=hold)
    return Allowed(inputs) if given is None else replace(given, inputs=inputs)
