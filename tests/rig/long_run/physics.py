"""What the truth's laws leave out: pumps that stand or run dry, a liquid that gets cold."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.prove.truth.plant import LIQUID_TEMPERATURE, Plant
from rulec.prove.truth.pumps import Centrifugal, Displacement, Pump
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR

OPEN = 2.0e-6 * BAR / LITRE_PER_HOUR**2
"""What a standing pump that lets liquid back loses, Pa/(m3/s)2. Origin: assumed; less than half of
its line."""

SHUT = 1.0e4 * OPEN
"""The same with a check valve, which lets nothing through."""

DRY_POWER = 0.3
"""Shaft power of a centrifugal pump full of air, as a share of that against a closed valve. Origin:
assumed; bearings, seal and motor stay."""

VISCOSITY_PER_KELVIN = 0.024
"""Fall of the viscosity of water per kelvin, as a share. Origin: assumed; water, 20 degC."""

BLASIUS = 0.25
"""Exponent of the viscosity in the friction of a smooth turbulent line (Blasius)."""

_NO_FLOW = 1.0e-10  # m3/s; where the root search starts, and what a dry pump delivers


@dataclass(frozen=True)
class Standing:
    """A pump with any law while it turns; while it stands, a passage: dp = -back Q |Q|."""

    running: Pump
    back: float

    def free_flow(self, speed: Array) -> Array:
        """Flow without back-pressure, m3/s."""
        return np.where(speed > 0.0, self.running.free_flow(speed), -1e3 * _NO_FLOW)

    def imbalance(self, speed: Array, flow: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """Of the law that holds, with its slopes by flow and by pressure."""
        law = self.running.imbalance(np.maximum(speed, 1e-3), flow, pressure)
        passage = pressure + self.back * flow * np.abs(flow)
        stands = (passage, 2.0 * self.back * np.abs(flow), np.ones_like(flow))
        turning = speed > 0.0
        found = [np.where(turning, a, b) for a, b in zip(law, stands, strict=True)]
        return found[0], found[1], found[2]

    def power(self, speed: Array, flow: Array, pressure: Array) -> Array:
        """Electric power, W; none while it stands."""
        return np.where(speed > 0.0, self.running.power(speed, flow, pressure), 0.0)


@dataclass(frozen=True)
class Dry:
    """A pump that finds air at its inlet where `dry`, shape (n,), is true: no flow, little power;
    a check valve holds the liquid behind it."""

    wet: Pump
    dry: Any

    def free_flow(self, speed: Array) -> Array:
        """Flow without back-pressure, m3/s."""
        return np.where(self.dry, _NO_FLOW, self.wet.free_flow(speed))

    def imbalance(self, speed: Array, flow: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """Of the law that holds, with its slopes by flow and by pressure."""
        law = self.wet.imbalance(speed, flow, pressure)
        none = (flow - _NO_FLOW, np.ones_like(flow), np.zeros_like(flow))
        found = [np.where(self.dry, b, a) for a, b in zip(law, none, strict=True)]
        return found[0], found[1], found[2]

    def power(self, speed: Array, flow: Array, pressure: Array) -> Array:
        """Electric power, W."""
        wet = self.wet.power(speed, flow, pressure)
        if isinstance(self.wet, Centrifugal):
            idle = DRY_POWER * self.wet.power(speed, np.zeros_like(flow), pressure)
        else:
            idle = self.wet.power(speed, flow, np.zeros_like(pressure))
        return np.where(self.dry, idle, wet)


def with_pump(plant: Plant, name: str, pump: Pump) -> Plant:
    """The plant with another pump in a module."""
    changed = replace(plant.modules[name], pump=pump)
    return replace(plant, modules={**plant.modules, name: changed})


def with_slip(plant: Plant, factor: Array) -> Plant:
    """The plant with the slip of all displacement pumps times a factor, shape (n,)."""
    scaled: Any = factor
    for name, module in plant.modules.items():
        if isinstance(module.pump, Displacement):
            pump = replace(
                module.pump,
                slip=module.pump.slip * scaled,
                slip_per_speed=module.pump.slip_per_speed * scaled,
                slip_linear=module.pump.slip_linear * scaled,
                slip_quadratic=module.pump.slip_quadratic * scaled,
            )
            plant = with_pump(plant, name, pump)
    return plant


def everywhere(plant: Plant, friction: Array) -> dict[str, Array]:
    """More friction (a share, shape (n,)) in all lines and mixers, as faults of the truth."""
    more, less = np.maximum(friction, 0.0), np.maximum(-friction, 0.0)
    names = [*plant.modules, *plant.mixers]
    found = {f"{name}.clogging": more for name in names}
    return found | ({f"{name}.widening": less for name in names} if less.any() else {})


def water_at(plant: Plant, temperature: Array) -> tuple[Plant, dict[str, Array]]:
    """The plant with water of some temperature, K: slip follows 1/viscosity, friction Blasius."""
    thicker = np.exp(-VISCOSITY_PER_KELVIN * (temperature - LIQUID_TEMPERATURE))
    return with_slip(plant, 1.0 / thicker), everywhere(plant, thicker**BLASIUS - 1.0)
