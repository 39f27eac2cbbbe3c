"""What an answer asks of a fitted model, whatever evidence it was fitted to."""

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
    """A course, SI, shape (n,), with factor, offset and unit in which it is shown."""

    course: Array
    factor: float
    offset: float
    unit: str

    def shown(self, values: Array | float) -> Array:
        """Values given in SI, in the unit; any shape."""
        return np.asarray((values - self.offset) / self.factor)


@dataclass(frozen=True)
class Pace:
    """A search for an end: `steps` at most, until the fall is `near` enough to what is asked for.

    A step grows by the factor `shortest` at least, and by `uphill` where the likelihood rises.
    """

    steps: int
    near: float
    shortest: float
    uphill: float


@dataclass(frozen=True, kw_only=True)
class Line:
    """The likelihood along one value, all other values refitted; SI.

    `u` is the standard uncertainty of the linearised model, `least` the smallest one that is
    reported. `fall` gives by how much the log likelihood falls a signed step away from `value`.
    `pace` says how an end of an interval is searched for.
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
    """A fitted model; values in SI by id.

    `joined` are its explanations. `free` names the values in `covariance`, shape (free, free).
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
        """When a fault was there, and its degree; none for what lasts."""

    @abstractmethod
    def term(self, candidate: Candidate) -> Array:
        """What a candidate changes, squared, per sample, shape (n,); NaN: not fitted to."""

    @abstractmethod
    def variables(self, module: str) -> Mapping[str, Variable]:
        """Courses in which a region can be told, those of the module first."""

    @abstractmethod
    def variable(self, name: str) -> Variable | None:
        """One course; None where it is not recorded."""


def unit_of_size(degree: Unknown) -> str:
    """The unit of a degree that is no share."""
    return "" if degree.unit == "%" else degree.unit
