"""Pump laws with their electric power; a law is an imbalance that vanishes.

The implicit form serves a displacement pump (flow follows pressure) and a centrifugal pump
(pressure follows flow) alike, and is smooth for both, which the root search needs.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .units import BAR, LITRE_PER_HOUR, MILLILITRE, RPM, Array


class Pump(Protocol):
    """A pump law; all arrays have shape (n,): speed rev/s, flow m3/s, pressure Pa."""

    def free_flow(self, speed: Array) -> Array:
        """Flow without back-pressure, m3/s: the start of the root search."""

    def imbalance(self, speed: Array, flow: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """Imbalance of the law, its slope by flow, its slope by pressure."""

    def power(self, speed: Array, flow: Array, pressure: Array) -> Array:
        """Electric power at the motor's input, W."""


@dataclass(frozen=True)
class Displacement:
    """Progressive cavity or membrane pump: swept volume less slip.

    flow = n V - C0 - C1 n - C_linear dp - C2 dp |dp|;  power = P0 + P1 n + n V dp / efficiency

    Attributes
    ----------
    volume, slip_per_speed : float, m3/rev
    slip : float, m3/s
    slip_linear, slip_quadratic : float, m3/s/Pa and m3/s/Pa2
    idle_power, power_per_speed : float, W and W s/rev
    efficiency : float, 1

    Source: Wetterich 2025, Eq. 1 (progressive cavity); linear slip and the power law as assumed
    in method.md, section 5. dp |dp| instead of dp2 keeps the slip a loss when dp is negative.
    """

    volume: float
    slip: float
    slip_per_speed: float
    slip_linear: float
    slip_quadratic: float
    idle_power: float
    power_per_speed: float
    efficiency: float

    def free_flow(self, speed: Array) -> Array:
        """Flow without back-pressure, m3/s."""
        return (self.volume - self.slip_per_speed) * speed - self.slip

    def imbalance(self, speed: Array, flow: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """Flow less the law's flow, m3/s, and its slopes."""
        slip = self.slip_linear * pressure + self.slip_quadratic * pressure * np.abs(pressure)
        by_pressure = self.slip_linear + 2.0 * self.slip_quadratic * np.abs(pressure)
        return flow - self.free_flow(speed) + slip, np.ones_like(flow), by_pressure

    def power(self, speed: Array, flow: Array, pressure: Array) -> Array:
        """Electric power, W; depends on the swept, not on the delivered flow."""
        hydraulic = speed * self.volume * pressure / self.efficiency
        return self.idle_power + self.power_per_speed * speed + hydraulic


@dataclass(frozen=True)
class Centrifugal:
    """Centrifugal pump: quadratic head and power curves with affinity scaling.

    With r = n / n0:  dp = r2 h0 + r h1 Q + h2 Q2;  power = r3 p0 + r2 p1 Q + r p2 Q2

    Attributes
    ----------
    head : tuple of 3 floats, Pa, Pa/(m3/s), Pa/(m3/s)2; h1, h2 <= 0, so that the curve falls
        for every flow > 0 and one root exists
    electric : tuple of 3 floats, W, W/(m3/s), W/(m3/s)2
    reference_speed : float, rev/s

    Source: affinity laws, method.md, section 5.
    """

    head: tuple[float, float, float]
    electric: tuple[float, float, float]
    reference_speed: float

    def free_flow(self, speed: Array) -> Array:
        """Flow without back-pressure, m3/s: the positive root of the head curve."""
        h0, h1, h2 = self.head
        root = -(h1 + math.sqrt(h1**2 - 4.0 * h0 * h2)) / (2.0 * h2)
        return root * speed / self.reference_speed

    def imbalance(self, speed: Array, flow: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """Pressure less the curve's pressure, Pa, and its slopes."""
        ratio = speed / self.reference_speed
        h0, h1, h2 = self.head
        curve = h0 * ratio**2 + h1 * ratio * flow + h2 * flow**2
        return pressure - curve, -(h1 * ratio + 2.0 * h2 * flow), np.ones_like(flow)

    def power(self, speed: Array, flow: Array, pressure: Array) -> Array:
        """Electric power, W."""
        ratio = speed / self.reference_speed
        p0, p1, p2 = self.electric
        return p0 * ratio**3 + p1 * ratio**2 * flow + p2 * ratio * flow**2


def progressive_cavity() -> Displacement:
    """Pump of modules A to C. Source: assumed set of method.md, section 5."""
    return Displacement(
        volume=10.0 * MILLILITRE,
        slip=6.0 * LITRE_PER_HOUR,
        slip_per_speed=0.010 * LITRE_PER_HOUR / RPM,
        slip_linear=0.0,
        slip_quadratic=2.0 * LITRE_PER_HOUR / BAR**2,
        idle_power=25.0,
        power_per_speed=0.095 / RPM,
        efficiency=0.70,
    )


def membrane() -> Displacement:
    """Pump of module D. Source: assumed set of method.md, section 5."""
    return Displacement(
        volume=50.0 * MILLILITRE,
        slip=2.0 * LITRE_PER_HOUR,
        slip_per_speed=0.02 * LITRE_PER_HOUR / RPM,
        slip_linear=6.0 * LITRE_PER_HOUR / BAR,
        slip_quadratic=0.0,
        idle_power=20.0,
        power_per_speed=0.25 / RPM,
        efficiency=0.65,
    )


def centrifugal(size: float = 0.15) -> Centrifugal:
    """Pump of module E: Wilo TOP-S 25/10 with flow and power scaled by `size`.

    The heads stay, so the scaled pump works near 500 l/h with the efficiency of the large one.

    Source: fit to TopS25slash10.mo (Modelica Buildings library), method.md, section 5.
    """
    flow = size * LITRE_PER_HOUR
    return Centrifugal(
        head=(1.111 * BAR, -1.713e-5 * BAR / flow, -6.84e-9 * BAR / flow**2),
        electric=(188.3 * size, 0.03228 * size / flow, -1.268e-6 * size / flow**2),
        reference_speed=2650.0 * RPM,
    )
