"""Operating points that may be run: within what was recorded or allowed, and when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.stats import qmc

from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.experiment.foretell import Places


@dataclass(frozen=True)
class Reach:
    """What may be set, and how far: by signal the lowest and highest value, SI; and how long a step
    lasts, s."""

    ranges: Mapping[str, tuple[float, float]]
    step: float


def usual_reach(system: System) -> Reach:
    """The range of each input that was changed while recording; steps as long as those were."""
    data, ranges = system.data, {}
    for signal in system.ruleset.signals:
        values = data.values.get(signal.id)
        if signal.is_input and values is not None and np.isfinite(values).any():
            low, high = float(np.nanmin(values)), float(np.nanmax(values))
            if high - low > limits.FEATURE_VARIES * float(np.nanmedian(data.noise[signal.id])):
                ranges[signal.id] = (low, high)
    return Reach(ranges, _usual_step(data.time))


def _usual_step(time: Array) -> float:
    """The usual time from one mean to the next, s."""
    steps = np.diff(np.sort(time))
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else limits.SHORTEST_STEP


def _corners(inputs: int) -> Array:
    """Shares of the ranges at their ends, shape (corners, inputs); half where inputs are many."""
    ways = [(0.0, 1.0) if i < limits.CORNERED else (0.5,) for i in range(inputs)]
    return np.array(list(product(*ways)))


def places_in(system: System, reach: Reach) -> Places:
    """Points that fill what may be set evenly, its corners among them."""
    names = sorted(reach.ranges)
    low, high = (np.array([reach.ranges[name][end] for name in names]) for end in (0, 1))
    between = qmc.Sobol(len(names), scramble=False).random_base2(limits.PLACES_DOUBLED)
    table = low + np.concatenate([_corners(len(names)), between]) * (high - low)
    data = system.data
    usable = np.flatnonzero(np.all([np.isfinite(v) for v in data.values.values()], axis=0))
    recorded = np.stack([data.values[name][usable] for name in names], axis=1)
    width = np.maximum(high - low, 1e-300)
    far = np.abs((table[:, None, :] - recorded[None, :, :]) / width).max(axis=2)
    last = float(data.time.max())
    return Places(
        inputs={name: table[:, i] for i, name in enumerate(names)},
        near=usable[far.argmin(axis=1)],
        time=np.full(len(table), last + reach.step),
    )
