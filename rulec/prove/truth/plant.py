"""The plant (a tree of dosing modules and mixers) and its operation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .pumps import Pump
from .units import ZERO_CELSIUS, Array

LIQUID_TEMPERATURE = 20.0 + ZERO_CELSIUS  # K


@dataclass(frozen=True)
class Line:
    """Dosing line: loss = static + quadratic Q |Q|; Pa and Pa/(m3/s)2."""

    static: float
    quadratic: float


@dataclass(frozen=True)
class Mixer:
    """Turbulent static mixer with valve: loss = quadratic Q |Q|; Pa/(m3/s)2."""

    quadratic: float


@dataclass(frozen=True)
class DosingModule:
    """Tank, pump and dosing line.

    Attributes
    ----------
    speed, slowest, fastest : float, rev/s; nominal speed and the range a maker calibrates
    throttles : tuple of floats, 1; settings of the maker's throttle, the loss it adds at the
        fastest speed's flow relative to the line's own; the same number for every module
    gear_ratio : float, 1; revolutions of the motor, whose converter shows the speed, per
        revolution or stroke of the pump
    """

    pump: Pump
    line: Line
    speed: float
    slowest: float
    fastest: float
    throttles: tuple[float, ...] = (0.0, 0.5, 1.2)
    gear_ratio: float = 1.0


@dataclass(frozen=True)
class Plant:
    """Dosing modules that feed mixers, mixers possibly in series.

    Attributes
    ----------
    downstream : the mixer next downstream of each module and mixer; None for an open end
    """

    modules: Mapping[str, DosingModule]
    mixers: Mapping[str, Mixer]
    downstream: Mapping[str, str | None]

    def path(self, name: str) -> list[str]:
        """Return the mixers downstream of a module or mixer, nearest first.

        Raises ValueError if the path names no mixer of the plant or returns to itself.
        """
        found: list[str] = []
        mixer = self.downstream[name]
        while mixer is not None:
            if mixer not in self.mixers or mixer in found:
                raise ValueError(f"downstream of '{name}': '{mixer}' is no mixer, or in a loop")
            found.append(mixer)
            mixer = self.downstream[mixer]
        return found

    @cached_property
    def feeds(self) -> Array:
        """1 if a mixer is downstream of a module, else 0; shape (modules, mixers)."""
        rows = [[mixer in self.path(name) for mixer in self.mixers] for name in self.modules]
        return np.array(rows, dtype=np.float64).reshape(len(self.modules), len(self.mixers))


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
