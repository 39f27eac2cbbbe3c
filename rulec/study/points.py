"""Operating points of a study: inputs spread over the range in which the plant is used."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec

from rulec.simulation.equations import Equations, SimulationRefused
from rulec.simulation.simulate import simulate_with
from rulec.study.limits import HIGHEST_INPUT, LOWEST_INPUT, POINT_ROUNDS, STUDY_SEED


@dataclass(frozen=True)
class Points:
    """Operating points at which the healthy plant can run.

    `given` holds an array per input, shape (n,), SI; the first is the reference point.
    """

    given: Mapping[str, Array]

    def __len__(self) -> int:
        return min((len(v) for v in self.given.values()), default=1)


def operating_points(equations: Equations, count: int) -> Points:
    """The reference point, then a Latin hypercube over the ranges of the inputs.

    There may be fewer than `count` if the plant can rarely run, and there is one if it has no input
    to vary. Raises `SimulationRefused` if the healthy plant cannot even run at its reference point.

    Source: McKay, Beckman and Conover 1979.
    """
    ranges = [range_of(signal) for signal in equations.given_signals]
    low, high = (np.array(side) for side in zip(*ranges, strict=True)) if ranges else (0.0, 0.0)
    reference = np.array([s.reference for s in equations.given_signals])
    first = simulate_with(equations, _named(equations, np.clip(reference, low, high)[None]), {})
    if not first.solved[0]:
        raise SimulationRefused(first.why(0))
    found = [np.clip(reference, low, high)]
    random = np.random.default_rng(STUDY_SEED)
    for _ in range(POINT_ROUNDS if np.any(high > low) else 0):
        if len(found) >= count:
            break
        # One point in each slice of each dimension, shape (count - 1, inputs).
        slices = np.array([random.permutation(count - 1) for _ in ranges]).T
        share = (slices + random.random((count - 1, len(ranges)))) / (count - 1)
        candidates = low + share * (high - low)
        solved = simulate_with(equations, _named(equations, candidates), {}).solved
        found += list(candidates[solved])
    return Points(_named(equations, np.array(found[:count])))


def range_of(signal: SignalSpec) -> tuple[float, float]:
    """Ends of the range to vary, SI: the calibrated range, or shares of the reference value in the
    reading's unit."""
    if signal.valid_from is not None and signal.valid_to is not None:
        low, high = signal.valid_from, signal.valid_to
    else:
        size = signal.reference - signal.offset
        low, high = sorted(
            (signal.offset + LOWEST_INPUT * size, signal.offset + HIGHEST_INPUT * size)
        )
    if signal.minimum is not None:
        low, high = max(low, signal.minimum), max(high, signal.minimum)
    return low, high


def _named(equations: Equations, points: Array) -> dict[str, Array]:
    return {name: points[:, i] for i, name in enumerate(equations.given)}
