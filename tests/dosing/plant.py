"""A dosing plant with its true laws, and its operation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rulec.prove.truth.settled.rig import UNITS, Rig
from rulec.prove.truth.settled.solve import Term
from rulec.prove.truth.units import ZERO_CELSIUS, Array

LIQUID_TEMPERATURE = 20.0 + ZERO_CELSIUS  # K


@dataclass(frozen=True)
class Duty:
    """How a maker runs a dosing module.

    Attributes
    ----------
    speed, slowest, fastest : float, rev/s; nominal speed and the range a maker calibrates
    throttles : tuple of floats, 1; settings of the maker's throttle, the loss it adds at the
        fastest speed's flow relative to the line's own; the same number for every module
    """

    speed: float
    slowest: float
    fastest: float
    throttles: tuple[float, ...]


@dataclass(frozen=True)
class Plant:
    """Dosing modules that feed mixers, mixers possibly in series.

    Attributes
    ----------
    rig : its drawing
    values : true parameters, SI, by `module.parameter`; each a number, or of shape (n,)
    terms : true laws beyond the plain ones
    """

    rig: Rig
    values: Mapping[str, Any]
    terms: tuple[Term, ...] = ()

    @cached_property
    def modules(self) -> dict[str, Duty]:
        """The duty of each dosing module."""
        found = {}
        for name in self.rig.pumps:
            speed, slowest, fastest = map(UNITS.of, self.rig.kind(name).stated["duty"])
            throttles = self.rig.kind(name).stated["throttles"]
            found[name] = Duty(speed, slowest, fastest, tuple(throttles))
        return found

    def with_values(self, values: Mapping[str, Any]) -> Plant:
        """Return the plant with other values of some parameters."""
        return replace(self, values={**self.values, **values})


@dataclass(frozen=True)
class Operation:
    """The settings of the operator, sample by sample.

    Attributes
    ----------
    time : ndarray, shape (n,), s
    speed : per module ndarray, shape (n,), rev/s
    throttle : per module ndarray, shape (n,), Pa/(m3/s)2; a maker's extra valve behind the line
    on_bench : None or ndarray, shape (n,), bool; True while every module stands alone on the
        maker's test bench, where its throttle takes the place of the mixers
    temperature : per module ndarray, shape (n,), K; of the liquid, 20 degC where not given
    """

    time: Array
    speed: Mapping[str, Array]
    throttle: Mapping[str, Array] = field(default_factory=dict)
    on_bench: NDArray[np.bool_] | None = None
    temperature: Mapping[str, Array] = field(default_factory=dict)

    @property
    def mixers_fitted(self) -> NDArray[np.bool_]:
        """True where the mixers are in place; shape (n,)."""
        if self.on_bench is None:
            return np.ones(self.time.size, dtype=np.bool_)
        return ~self.on_bench
