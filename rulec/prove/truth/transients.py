"""Transients between plateaus: speeds and valves approach their settings.

The liquid follows within milliseconds, so every sample is an operating point of its own
(quasi-stationary). A sensor fault jumps, because nothing moves.
"""

from dataclasses import replace

import numpy as np

from .runs import Run
from .units import Array

MOVED_BY_A_VALVE = (".leakage", ".clogging", ".widening")

SPEED_TIME, VALVE_TIME = 1.0, 1.5
"""Time constants, s; assumed: a converter's speed ramp, a motorised valve of a small rig."""


def settling(run: Run) -> Run:
    """Return the run with its values as settings that speeds and valves approach.

    Raises ValueError for a run on the bench, whose throttle is not there afterwards.
    """
    operation = run.operation
    if operation.on_bench is not None:
        raise ValueError("a run on the maker's bench is set up point by point, without transients")
    speed = {
        name: approach(operation.time, value, SPEED_TIME) for name, value in operation.speed.items()
    }
    faults = {
        name: approach(operation.time, degree, VALVE_TIME)
        if name.endswith(MOVED_BY_A_VALVE)
        else degree
        for name, degree in run.faults.items()
    }
    return Run(run.plant, replace(operation, speed=speed), faults)


def approach(time: Array, setting: Array, time_constant: float) -> Array:
    """Return the first-order approach to a setting, settled at the first sample; shape (n,).

    The setting of a sample holds since the sample before.

    Source: exact solution of `time_constant dy/dt = setting - y` for a constant setting.
    """
    value = np.array(setting, dtype=np.float64)
    for k, left in enumerate(np.exp(-np.diff(time) / time_constant), start=1):
        value[k] = setting[k] + left * (value[k - 1] - setting[k])
    return value


def late(value: Array, by: int) -> Array:
    """Delay a course by `by` samples; it begins with its first value; shape (n,)."""
    return np.concatenate([np.full(by, value[0]), value[:-by]])
