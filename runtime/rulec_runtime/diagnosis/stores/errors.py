"""Lasting errors of parameters, inputs and sensors, and what is known about them.

Each is an unknown with a standard normal prior. A non-zero parameter has it on a logarithmic scale:
it keeps its sign, however uncertain it is. Correlations of parameters are neglected. Windows
without a fault narrow the errors, and later ones are judged with these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.baseline import remembered
from rulec_runtime.diagnosis.stores.free_balances import error_of
from rulec_runtime.recordings.stationary import systematic_u


@dataclass(frozen=True)
class LastingError:
    """A lasting error: `input` is its plan input, or `output` the number of the reading it shifts.

    An error of 1 multiplies `value` by exp(`size`), or adds `size` (SI) if `value` is 0.
    """

    input: str
    output: int
    value: float
    size: float

    def at(self, error: float) -> float:
        """Value at an error."""
        if self.value:
            return float(self.value * np.exp(self.size * error))
        return self.size * error

    def slope(self, error: float) -> float:
        """Derivative of the value by the error."""
        return self.size * self.at(error) if self.value else self.size


@dataclass(frozen=True)
class KnownErrors:
    """What is known about all errors: mean and covariance, at a time, from so many windows."""

    mean: Array
    covariance: Array
    time: float = 0.0
    windows: int = 0

    def later(self, time: float, drifts: Array) -> KnownErrors:
        """What is still known at a later time; `drifts` flags those that return to their prior."""
        kept = np.where(drifts, remembered(time - self.time), 1.0)
        covariance = self.covariance * np.outer(kept, kept) + np.diag(1.0 - kept**2)
        return replace(self, mean=kept * self.mean, covariance=covariance, time=time)


def lasting_errors(ruleset: Ruleset, reached: frozenset[str], level: Array) -> list[LastingError]:
    """Errors of a plant that affect a measured value: of the plan inputs `reached`, and of outputs,
    whose median is `level`, SI."""
    dynamics, signals = ruleset.dynamics, ruleset.signal_by_id
    assert dynamics is not None
    found = []
    for name, value in dynamics.values.items():
        u = dynamics.uncertainties[name]
        if name in reached:
            size = float(np.log1p(u / abs(value))) if value else u
            found.append(LastingError(name, -1, value, size))
    for name in dynamics.inputs:
        u = float(systematic_u(signals[name], signals[name].reference))
        if error_of(name) in reached:
            found.append(LastingError(error_of(name), -1, 0.0, u))
    for i, name in enumerate(dynamics.outputs):
        found.append(LastingError("", i, 0.0, float(systematic_u(signals[name], level[i]))))
    return [error for error in found if error.size > 0.0]
