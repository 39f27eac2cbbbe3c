"""What the truth's laws leave out: pumps that stand or run dry, a liquid that gets cold."""

from dataclasses import dataclass, fields, replace
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


@dataclass(frozen=True)
class Idle:
    """A pump that does not pump for a while: off, or dry.

    Attributes
    ----------
    pump : its law while it pumps
    idle : shape (n,); when it does not, and is a passage instead: dp = -back Q |Q|
    back : Pa/(m3/s)2; of a check valve, `SHUT`
    """

    pump: Pump
    idle: Any
    back: float = SHUT

    def free_flow(self, speed: Array) -> Array:
        """Flow without back-pressure, m3/s; next to none while idle."""
        return np.where(self.idle, -1e-7, self.pump.free_flow(speed))

    def imbalance(self, speed: Array, flow: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """Of the law that holds, with its slopes by flow and by pressure."""
        law = self.pump.imbalance(np.maximum(speed, 1e-3), flow, pressure)
        passage = pressure + self.back * flow * np.abs(flow)
        idle = (passage, 2.0 * self.back * np.abs(flow), np.ones_like(flow))
        found = [np.where(self.idle, b, a) for a, b in zip(law, idle, strict=True)]
        return found[0], found[1], found[2]

    def power(self, speed: Array, flow: Array, pressure: Array) -> Array:
        """Electric power, W; of a dry one that of friction alone, of one that is off none."""
        none = np.zeros_like(flow)
        dry = self.pump.power(speed, none, none)
        dry = dry * (DRY_POWER if isinstance(self.pump, Centrifugal) else 1.0)
        wet = self.pump.power(speed, flow, pressure)
        return np.where(self.idle, dry * (speed > 0.0), wet)


def with_pump(plant: Plant, name: str, pump: Pump) -> Plant:
    changed = replace(plant.modules[name], pump=pump)
    return replace(plant, modules={**plant.modules, name: changed})


def with_slip(plant: Plant, factor: Array) -> Plant:
    """The plant with the slip of all displacement pumps times a factor, shape (n,)."""
    scaled: Any = factor
    for name, module in plant.modules.items():
        if isinstance(module.pump, Displacement):
            slips = [f.name for f in fields(module.pump) if f.name.startswith("slip")]
            changed = {slip: getattr(module.pump, slip) * scaled for slip in slips}
            plant = with_pump(plant, name, replace(module.pump, **changed))
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
