"""A stationary plant: kinds of pumps from `pumps.yaml`, its modules, its sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .. import units
from ..formulas import Names
from ..sensors import Sensor
from ..units import Array

Values = Mapping[str, float]
Numbers = Mapping[str, tuple[float, float]]
"""Value and standard uncertainty, or lowest and highest value, SI."""

UNITS = Names(None, {**vars(units), "LH": units.LITRE_PER_HOUR, "LM": 1e-3 / 60.0})


@dataclass(frozen=True)
class PumpKind:
    """A kind of pump and its dosing line; a valve likewise. See `pumps.yaml`; all SI."""

    stated: Mapping[str, Any]
    numbers: Numbers
    sensors: Mapping[str, Sensor]
    speeds: tuple[float, float]
    settings: Numbers

    @classmethod
    def of(cls, stated: Mapping[str, Any]) -> PumpKind:
        """Read an entry of the table."""
        sensors = {name: _sensor(*entry) for name, entry in stated["sensors"].items()}
        settings = {name: _ends(ends) for name, ends in stated["settings"].items()}
        return cls(stated, _numbers(stated), sensors, _ends(stated["rev/s"]), settings)

    @property
    def type(self) -> str:
        """Module type of the tool that describes it."""
        return str(self.stated["type"])

    @property
    def rising(self) -> bool:
        """Whether the power rises with the pressure."""
        return bool(self.stated.get("rising", True))

    @property
    def by_head(self) -> bool:
        """Whether the root search needs the head."""
        return "head" in self.stated

    def flow(self, p: Mapping[str, Any], speed: Array, pressure: Array) -> tuple[Array, Array]:
        """Return the flow without slip by pressure, and that slip, by parameters and speed."""
        names = Names(None, {}, **p, speed=speed, pressure=pressure)
        names.fix(self.stated["flow"])
        return names["free"], names["slip"]

    def power(self, p: Mapping[str, Any], speed: Array, pressure: Array, flow: Array) -> Array:
        """Return the power, W."""
        names = Names(None, {}, **p, speed=speed, pressure=pressure, flow=flow)
        return np.asarray(names.of(self.stated["power"]))

    def head(self, p: Mapping[str, Any], speed: Array, flow: Array) -> Array:
        """Return the pressure, Pa."""
        return np.asarray(Names(None, {}, **p, speed=speed, flow=flow).of(self.stated["head"]))


def _ends(formulas: Sequence[str]) -> tuple[float, float]:
    low, high = map(UNITS.of, formulas)
    return float(low), float(high)


def _numbers(stated: Mapping[str, Any]) -> Numbers:
    numbers = {name: (v, u, UNITS.of(unit)) for name, (v, u, unit) in stated["numbers"].items()}
    return {name: (value * unit, u * unit) for name, (value, u, unit) in numbers.items()}


def _sensor(unit: str, scale: str, bound: float, more: str = "") -> Sensor:
    relative = more == "relative"
    offset = UNITS.of(more) if more and not relative else 0.0
    return Sensor(unit, UNITS.of(scale), bound, offset, relative)


_TABLE = yaml.safe_load(Path(__file__).with_name("pumps.yaml").read_text(encoding="utf-8"))

PUMPS: Mapping[str, PumpKind] = {k: PumpKind.of(stated) for k, stated in _TABLE["pumps"].items()}

MIXER = _numbers(_TABLE["mixer"])

OVER_MIXER = _sensor(*_TABLE["mixer"]["sensor"])
"""Of the pressure that a mixer loses."""


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
    def _first(self) -> Mapping[str, Any]:
        """The kind of the first pump; all are set alike."""
        return PUMPS[next(iter(self.pumps.values()))].stated

    @property
    def _set(self) -> Sequence[str]:
        """Signals that are set, the same for all pumps."""
        found: Sequence[str] = self._first["inputs"]
        return found

    @property
    def around(self) -> Mapping[str, str]:
        """Signals beside T and l that no pump sets or causes, the same for all, with formulas."""
        found: Mapping[str, str] = self._first.get("around", {})
        return found

    @property
    def by_load(self) -> bool:
        """Whether the load sets the pressure, and the flow is metered."""
        return "dp" in self._set

    @property
    def by_travel(self) -> bool:
        """Whether valves, set by their travel, take the place of pumps."""
        return "x" in self._set

    @property
    def by_meter(self) -> bool:
        """Whether a valve behind the pump sets the flow, which is metered."""
        return "Q" in self._set

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
        found = {}
        for module in self.pumps:
            for name, sensor in self.kind(module).sensors.items():
                gear = self.kind(module).stated.get("gear", 1.0) if name == "n" else 1.0
                found[f"{module}.{name}"] = replace(sensor, bound=sensor.bound / gear)
        return found | {f"{mixer}.dp": OVER_MIXER for mixer in self.mixers}

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Signals that are set, not caused."""
        return tuple(f"{module}.{name}" for module in self.pumps for name in self._set)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Signals that the plant's physics causes, without flow meters unused in diagnosis."""
        caused = [(m, name) for m in self.pumps for name in self.kind(m).stated["outputs"]]
        caused += [(mixer, "dp") for mixer in self.mixers]
        return tuple(f"{module}.{name}" for module, name in caused)
