"""The prior of the size of an amplitude, by its entry in the catalogue."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr, stdtrit

from rulec.effects.candidate import Candidate, Unknown
from rulec.knowledge.knowledge import has_no_zero
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.screen import references, starts
from rulec.mismatch.evidence.steady.system import System


@dataclass(frozen=True)
class Size:
    """Prior of the distance of an amplitude from its null.

    A Student distribution about the `usual` size with a `width`, infinite where none is stated, and
    `freedom`. `scale` is that of a Student distribution about the null whose median distance is
    the usual one; its tail falls as that of the log-normal distribution at two standard deviations.
    """

    scale: float
    freedom: float
    usual: float = 0.0
    width: float = float("inf")


def log_inside(size: Size, unknown: Unknown) -> float:
    """Logarithm of the prior share of amplitudes within the range of an unknown; both signs are
    equally likely."""
    null = unknown.null or 0.0
    ends = np.array([unknown.lowest - null, unknown.highest - null])
    signs = (np.array([1.0]), np.array([-1.0]))
    shares = [np.diff(stdtr(size.freedom, (ends - s * size.usual) / size.width))[0] for s in signs]
    return float(np.log(max(sum(shares), 1e-12)))


def size_of(unknown: Unknown, share: Callable[[], float]) -> Size:
    """The prior of an amplitude by the usual size in its entry.

    `share` gives the relative change of its place per amplitude.
    """
    usual = unknown.usual
    if usual is None:
        width = unknown.highest - unknown.lowest
        return Size(width / 4.0 if np.isfinite(width) else 1.0, 1.0)
    spread = float(np.log(usual.factor))
    freedom = 2.0 / spread
    median = usual.size / share() if usual.of_place else usual.size
    return Size(median / float(stdtrit(freedom, 0.75)), freedom, median, median * spread)


def share_of(system: System, candidate: Candidate, unknown: Unknown) -> float:
    """Largest relative change of estimates per amplitude, over all shapes.

    For a reading whose zero is arbitrary it is relative to the range of the sensor.
    """
    null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
    fixed, shares = references(system, candidate), []
    plain = system.flows(Configuration()).values
    reading = _without_zero(system, candidate)
    for shape in starts(system, candidate):
        setting = Configuration().joining(candidate, {**null, **shape}, fixed)
        modules = system.reached(candidate.observers)
        flows = system.flows(setting, [unknown.id], modules=modules)
        for i, slope in flows.by_value[unknown.id].items():
            whole = plain[i]
            if reading is not None:
                whole = flows.by_reading[reading][i] * span(system, reading)
            with np.errstate(invalid="ignore", divide="ignore"):
                share = np.broadcast_to(slope / whole, plain[i].shape)
            share = share[system.data.open & system.valid[i] & np.isfinite(share)]
            shares.append(float(np.sqrt(np.mean(share**2))) if len(share) else 0.0)
    return max(shares, default=0.0) or 1.0


def _without_zero(system: System, candidate: Candidate) -> str | None:
    """The reading that a candidate corrects, if its zero is arbitrary.

    A share of a temperature means nothing: 5 % of 20 degC would be 15 kelvin.
    """
    signal, plant = f"{candidate.module}.{candidate.place}", system.builder.network.plant
    if signal not in system.shared:
        return None
    own = plant.modules[candidate.module].type.signals[candidate.place]
    return signal if has_no_zero(own, plant.knowledge.units) else None


def span(system: System, signal: str) -> float:
    """Range of a sensor, SI, or of its readings where none is stated."""
    low, high = system.ruleset.signal_by_id[signal].ends
    if np.isfinite(high - low):
        return high - low
    values = system.data.values[signal]
    return float(np.nanmax(values) - np.nanmin(values))
