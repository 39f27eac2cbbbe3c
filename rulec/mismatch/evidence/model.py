"""The interface between answers and a fitted model of any plant."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.candidate import Candidate, Unknown
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch.evidence.samples import Samples
from rulec.mismatch.result import Estimate, Period


@dataclass(frozen=True)
class Variable:
    """A course, SI, shape (n,), with the factor, offset and unit of its display."""

    course: Array
    factor: float
    offset: float
    unit: str

    def shown(self, values: Array | float) -> Array:
        """Values in SI, any shape, converted to the unit."""
        return np.asarray((values - self.offset) / self.factor)


@dataclass(frozen=True)
class Pace:
    """The search for an end of an interval: at most `steps`, until the fall is within `near` of its
    target. A step grows at least by the factor `shortest`, and by `uphill` where the likelihood
    rises.
    """

    steps: int
    near: float
    shortest: float
    uphill: float


@dataclass(frozen=True, kw_only=True)
class Line:
    """The likelihood along one value, SI, with all other values refitted.

    `u` is the standard uncertainty of the linearised model, `least` the smallest one to report.
    `fall` gives the fall of the log likelihood at a signed step from `value`. `pace` controls the
    search for an end of an interval.
    """

    value: float
    u: float
    least: float
    lowest: float
    highest: float
    fall: Callable[[float], float]
    pace: Pace


@dataclass(frozen=True, kw_only=True)
class Model(ABC):
    """A fitted model; `joined` are its explanations.

    `free` are the ids of the values in `covariance`, SI, shape (free, free).
    """

    ruleset: Ruleset
    builder: ModelBuilder
    samples: Samples
    joined: tuple[Candidate, ...]
    free: tuple[str, ...]
    covariance: Array

    @abstractmethod
    def line(self, name: str) -> Line:
        """The likelihood along a free value."""

    @abstractmethod
    def periods(
        self, candidate: Candidate, estimates: Mapping[str, Estimate]
    ) -> tuple[Period, ...]:
        """Periods of a fault and its degrees; none for a permanent one."""

    @abstractmethod
    def term(self, candidate: Candidate) -> Array:
        """Squared change by a candidate per sample, shape (n,); NaN where it was not fitted."""

    @abstractmethod
    def variables(self, module: str) -> Mapping[str, Variable]:
        """Courses that may define a region, those of the module first."""

    @abstractmethod
    def variable(self, name: str) -> Variable | None:
        """One course; None where it is not recorded."""


def unit_of_size(degree: Unknown) -> str:
    """The unit of a degree, empty for a share."""
    return "" if degree.unit == "%" else degree.unit
