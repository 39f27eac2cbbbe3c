"""How large an amplitude may be before the recording is seen, as its entry says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr, stdtrit

from rulec.effects.candidate import Candidate, Unknown
from rulec.knowledge.degree_unit import has_no_zero
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.screen import references, starts
from rulec.mismatch.evidence.steady.system import System


@dataclass(frozen=True)
class Size:
    """Prior of the size of an amplitude, its distance from its null: Student about the `usual` one
    with a `width`, which is infinite where nobody knows, and degrees of freedom.

    `scale` is that of a Student distribution about the null of which half are below the usual one;
    the tail falls as that of the log-normal distribution does at two of its standard deviations.
    """

    scale: float
    freedom: float
    usual: float = 0.0
    width: float = float("inf")


def log_inside(size: Size, unknown: Unknown) -> float:
    """Logarithm of the share of all amplitudes that the range of an unknown leaves, of either sign:
    as many are thought of below the null as above it."""
    null = unknown.null or 0.0
    ends = np.array([unknown.lowest - null, unknown.highest - null])
    signs = (np.array([1.0]), np.array([-1.0]))
    shares = [np.diff(stdtr(size.freedom, (ends - s * size.usual) / size.width))[0] for s in signs]
    return float(np.log(max(sum(shares), 1e-12)))


def size_of(unknown: Unknown, share: Callable[[], float]) -> Size:
    """The prior of an amplitude by what its entry says is usual.

    `share` is the share by which its place changes per amplitude.
    """
    usual = unknown.usual
    if usual is None:
        width = unknown.highest - unknown.lowest
        return Size(width / 4.0 if np.isfinite(width) else 1.0, 1.0)
    freedom = 2.0 / float(np.log(usual.factor))
    median = usual.size / share() if usual.of_place else usual.size
    return Size(
        median / float(stdtrit(freedom, 0.75)),
        freedom,
        median,
        median * float(np.log(usual.factor)),
    )


def share_of(system: System, candidate: Candidate, unknown: Unknown) -> float:
    """The share by which estimates change per amplitude, the most at any shape.

    A reading whose zero is arbitrary has no share: there it is the change of the reading, as share
    of what its sensor can show.
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
    """The reading that a candidate puts right, if its zero is arbitrary."""
    signal = f"{candidate.module}.{candidate.place}"
    known = signal in system.shared and _zero_is_arbitrary(system, signal)
    return signal if known else None


def _zero_is_arbitrary(system: System, signal: str) -> bool:
    """Is the zero of a signal where somebody put it? A share of a temperature means nothing: 5 % of
    20 degC would be 15 kelvin."""
    module, _, name = signal.partition(".")
    plant = system.builder.network.plant
    return has_no_zero(plant.modules[module].type.signals[name], plant.knowledge.units)


def span(system: System, signal: str) -> float:
    """What a sensor can show, SI, or where nobody says it, what it showed."""
    low, high = system.ruleset.signal_by_id[signal].ends
    if np.isfinite(high - low):
        return high - low
    values = system.data.values[signal]
    return float(np.nanmax(values) - np.nanmin(values))
