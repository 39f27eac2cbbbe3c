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
    """How a maker runs a dosing module: nominal speed and the range he calibrates, rev/s; settings
    of his throttle, the loss it adds at the fastest speed's flow by the line's own."""

    speed: float
    slowest: float
    fastest: float
    throttles: tuple[float, ...]


@dataclass(frozen=True)
class Plant:
    """Dosing modules that feed mixers, mixers possibly in series: true parameters, SI, by
    `module.parameter`, each a number or of shape (n,); `terms` are true laws beyond the plain."""

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
    """The settings of the operator, each of shape (n,): time, s, and by module speeds, rev/s, a
    maker's extra valve behind the line, Pa/(m3/s)2, and the liquid's temperature, K (else 20 degC).
    `on_bench`: every module stands alone, with that valve in place of the mixers."""

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
