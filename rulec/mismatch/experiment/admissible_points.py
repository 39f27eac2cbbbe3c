"""Operating points that may be run: within what was recorded or allowed, and when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.limits import SETTLING
from rulec_runtime.recordings.recording import Recording
from scipy.stats import qmc

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.foretell import Places
from rulec.mismatch.experiment.surroundings import surroundings, unset
from rulec.separation.allowed import Allowed


@dataclass(frozen=True)
class Reach:
    """What may be set, and how far: by signal the lowest and highest value, SI; and how long a step
    lasts at least, s.

    `present` are inputs as they were last, SI. With `allowed`, inputs that have no range stay
    there.
    """

    ranges: Mapping[str, tuple[float, float]]
    step: float
    present: Mapping[str, float] = field(default_factory=dict)
    allowed: Allowed | None = None


def present_inputs(ruleset: Ruleset, recording: Recording) -> dict[str, float]:
    """Inputs as they were recorded last, SI."""
    present = {}
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if signal.is_input and values is not None and np.isfinite(values).any():
            present[signal.id] = float(values[np.isfinite(values)][-1])
    return present


def usual_reach(system: System, present: Mapping[str, float], sample: float) -> Reach:
    """The range of each input that was changed while recording; steps as long as those were, and so
    long that they are seen to settle, with samples of so many seconds."""
    data, ranges = system.data, {}
    for signal in system.ruleset.signals:
        values = data.values.get(signal.id)
        if not signal.is_input or values is None:
            continue
        # Where a pump stands no equation holds, and nothing between is known to run.
        least = -np.inf if signal.minimum is None else signal.minimum
        ran = values[np.isfinite(values) & (values >= least)]
        if len(ran):
            low, high = float(ran.min()), float(ran.max())
            if high - low > common.FEATURE_VARIES * float(np.nanmedian(data.noise[signal.id])):
                ranges[signal.id] = (low, high)
    return Reach(ranges, _usual_step(data, sample), present)


def limited_reach(
    system: System, present: Mapping[str, float], allowed: Allowed, sample: float
) -> Reach:
    """The ranges that are allowed of inputs that were recorded; `present` is where they are."""
    ranges = {
        name: (min(ends), max(ends))
        for name, own in allowed.inputs.items()
        if name in present
        for ends in [(own.si(own.lowest), own.si(own.highest))]
    }
    return Reach(ranges, _usual_step(system.data, sample), present, allowed)


def _usual_step(data: Data, sample: float) -> float:
    """The usual time from one mean to the next, s.

    Where several inputs are changed in turn that is shorter than one step that changes them all
    takes until its readings have settled and give a mean.
    """
    steps = np.diff(np.sort(data.time))
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else limits.SHORTEST_STEP
    return usual if data.of_rows else max(usual, (SETTLING + limits.HELD_SAMPLES) * sample)


def _corners(inputs: int) -> Array:
    """Shares of the ranges at their ends, shape (corners, inputs); half where inputs are many."""
    ways = [(0.0, 1.0) if i < limits.CORNERED else (0.5,) for i in range(inputs)]
    return np.array(list(product(*ways)))


def places_in(system: System, reach: Reach) -> Places:
    """Points that fill what may be set evenly, its corners among them; the last is the present one.

    Where ranges are allowed ones, values are easy to set.
    """
    names = sorted(reach.ranges)
    low, high = (np.array([reach.ranges[name][end] for name in names]) for end in (0, 1))
    between = qmc.Sobol(len(names), scramble=False).random_base2(limits.PLACES_DOUBLED)
    table = low + np.concatenate([_corners(len(names)), between]) * (high - low)
    if reach.allowed is not None:
        for column, name in zip(table.T, names, strict=True):
            column[:] = reach.allowed.inputs[name].easy(column)
        stay = [name for name in sorted(reach.present) if name not in names]
        names += stay
        table = table[np.sort(np.unique(table, axis=0, return_index=True)[1])]
        kept = np.array([reach.present[name] for name in stay])
        table = np.concatenate([table, np.tile(kept, (len(table), 1))], axis=1)
        low, high = np.concatenate([low, kept]), np.concatenate([high, kept])
    table = np.concatenate([table, [[reach.present[name] for name in names]]])
    data = system.data
    # A sensor that fails shows nothing at all.
    shown = [there for v in data.values.values() if (there := np.isfinite(v)).any()]
    usable = np.flatnonzero(np.all(shown, axis=0))
    recorded = np.stack([data.values[name][usable] for name in names], axis=1)
    # Of what stays as it is, the recorded points nearest to that come first.
    width = np.maximum(high - low, np.maximum(np.ptp(recorded, axis=0), 1e-300))
    far = np.abs((table[:, None, :] - recorded[None, :, :]) / width).max(axis=2)
    last = float(data.time.max())
    inputs = {name: table[:, i] for i, name in enumerate(names)}
    free = unset(system, names)
    return Places(
        inputs=inputs,
        near=usable[far.argmin(axis=1)],
        time=np.full(len(table), last + reach.step),
        around=surroundings(data.values, data.time, free, inputs),
    )
