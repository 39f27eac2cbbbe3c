"""A stationary plant: its modules and its sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..sensors import DOSING_SIGNALS, MIXER_SIGNALS, Sensor
from ..units import BAR, LITRE_PER_HOUR, ZERO_CELSIUS, Array
from .pumps import LM, MIXER, PUMPS, Numbers, PumpKind

LOAD_SIGNALS = {
    "dp": Sensor("bar", BAR, bound=0.25),
    "P_el": Sensor("W", 1.0, bound=0.002, relative=True),
    "T": Sensor("degC", 1.0, bound=0.3, offset=ZERO_CELSIUS),
    "Q": Sensor("l/min", LM, bound=0.005, relative=True),
}
"""Of an oil set; bounds of the sensor classes."""

BENCH_SIGNALS = {
    **{name: DOSING_SIGNALS[name] for name in ("n", "Q", "dp", "P_el", "T")},
    "p_s": Sensor("bar", BAR, bound=0.003),
}
"""Of a metered pump with a throttle before it."""

VALVE_SIGNALS = {
    "x": Sensor("%", 0.01, bound=0.5),
    "Q": Sensor("m3/h", 1e3 * LITRE_PER_HOUR, bound=0.004, relative=True),
    "dp": DOSING_SIGNALS["dp"],
    "p_1": Sensor("bar", BAR, bound=0.016),
    "rho": Sensor("kg/m3", 1.0, bound=1.0),
}
"""Of a control valve between two taps; bounds of the sensor classes."""


@dataclass(frozen=True)
class Rig:
    """The plant's drawing.

    Attributes
    ----------
    pumps : kind of each pump module
    mixers : size of each mixer, as multiple of the friction of the smallest
    downstream : the mixer next downstream of each module and mixer, None for an open end
    """

    name: str
    pumps: Mapping[str, str]
    mixers: Mapping[str, float]
    downstream: Mapping[str, str | None]

    def kind(self, module: str) -> PumpKind:
        """Return the kind of a pump module."""
        return PUMPS[self.pumps[module]]

    @property
    def by_load(self) -> bool:
        """Whether the load sets the pressure, and the flow is metered."""
        return self.by_temperature or self.by_travel or "oil-set" in self.pumps.values()

    @property
    def by_travel(self) -> bool:
        """Whether valves, set by their travel, take the place of pumps."""
        return "valve" in self.pumps.values()

    @property
    def setting(self) -> str:
        """Signal that sets a pump or valve."""
        return "x" if self.by_travel else "n"

    @property
    def gauge(self) -> str:
        """Signal of the pressure before a metered pump or a valve."""
        return "p_1" if self.by_travel else "p_s"

    @property
    def by_temperature(self) -> bool:
        """Whether the laws of its pumps depend on the temperature."""
        return "oil-warm" in self.pumps.values()

    @property
    def by_meter(self) -> bool:
        """Whether a valve behind the pump sets the flow, which is metered."""
        return "metered" in self.pumps.values()

    @cached_property
    def feeds(self) -> Array:
        """1 if a mixer is downstream of a pump, else 0; shape (pumps, mixers)."""
        rows = [[mixer in self.path(name) for mixer in self.mixers] for name in self.pumps]
        return np.array(rows, dtype=np.float64).reshape(len(self.pumps), len(self.mixers))

    def path(self, name: str) -> list[str]:
        """Return the mixers downstream of a module, nearest first."""
        found, at = [], self.downstream[name]
        while at is not None:
            found.append(at)
            at = self.downstream[at]
        return found

    @cached_property
    def numbers(self) -> Numbers:
        """All parameters with their uncertainties, SI, by `module.parameter`."""
        found = {
            f"{m}.{p}": number for m in self.pumps for p, number in self.kind(m).numbers.items()
        }
        for mixer, size in self.mixers.items():
            value, u = MIXER["k2"]
            found[f"{mixer}.k0"] = MIXER["k0"]
            found[f"{mixer}.k2"] = (value * size, u if size == 1.0 else 0.005 * value * size)
        return found

    @cached_property
    def sensors(self) -> Mapping[str, Sensor]:
        """All sensors by `module.signal`, in the order of the columns."""
        signals = LOAD_SIGNALS if self.by_load else DOSING_SIGNALS
        signals = BENCH_SIGNALS if self.by_meter else signals
        signals = VALVE_SIGNALS if self.by_travel else signals
        found = {}
        for module in self.pumps:
            for name, sensor in signals.items():
                bound = sensor.bound / (self.kind(module).gear if name == "n" else 1.0)
                found[f"{module}.{name}"] = replace(sensor, bound=bound)
        return found | {f"{mixer}.dp": MIXER_SIGNALS["dp"] for mixer in self.mixers}

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Signals that are set, not caused."""
        set_: tuple[str, ...] = ("dp",) if self.by_load else ("n", "Q") if self.by_meter else ("n",)
        set_ += ("T",) if self.by_temperature else ("x",) if self.by_travel else ()
        return tuple(f"{module}.{name}" for module in self.pumps for name in set_)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Signals that the plant's physics causes, without flow meters unused in diagnosis."""
        caused: tuple[str, ...] = ("P_el", "Q") if self.by_load else ("dp", "P_el")
        caused = ("Q",) if self.by_travel else caused
        names = [f"{module}.{name}" for module in self.pumps for name in caused]
        return (*names, *(f"{mixer}.dp" for mixer in self.mixers))
