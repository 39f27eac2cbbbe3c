"""Pumps by their parameters: flow and power at a speed and pressure, SI; a valve likewise.

The numbers repeat those of the module types, as the truth reads no file of the tool. A test
compares them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, MILLILITRE, RPM, ZERO_CELSIUS, Array

Values = Mapping[str, float]
Numbers = Mapping[str, tuple[float, float]]
"""Value and standard uncertainty, SI."""

LH, LM = LITRE_PER_HOUR, 1e-3 / 60.0


@dataclass(frozen=True)
class PumpKind:
    """A kind of pump and its dosing line.

    Attributes
    ----------
    type : module type of the tool that describes it
    numbers : parameters, SI
    speeds : rev/s, slowest and fastest in use
    gear : revolutions of the motor, whose converter shows the speed, per stroke
    flow : (parameters, shaft speed, pressure) -> flow without slip by pressure, and that slip
    power : (parameters, shaft speed, pressure, flow) -> W
    head : (parameters, shaft speed, flow) -> pressure, if the root search needs it: the flow of a
        centrifugal pump has no slope near shut-off
    rising : whether the power rises with the pressure
    """

    type: str
    numbers: Numbers
    speeds: tuple[float, float]
    gear: float
    flow: Callable[[Values, Array, Array], tuple[Array, Array]]
    power: Callable[[Values, Array, Array, Array], Array]
    head: Callable[[Values, Array, Array], Array] | None = None
    rising: bool = True


WARMED = ZERO_CELSIUS + 45.0
"""Temperature, K, at which the laws of a warm oil set hold."""


def _scaled(unit: float, value: float, u: float) -> tuple[float, float]:
    return value * unit, u * unit


LINE: Numbers = {"k0": _scaled(BAR, 0.05, 0.002), "k2": _scaled(BAR / LH**2, 5.2e-6, 2.0e-8)}

CAVITY: Numbers = {
    "V": (10.0 * MILLILITRE, 0.0),
    "C0": _scaled(LH, 6.0, 0.5),
    "C1": _scaled(LH / RPM, 0.010, 0.001),
    "C2": _scaled(LH / BAR**2, 2.0, 0.1),
    "P0": (25.0, 0.5),
    "P1": _scaled(1.0 / RPM, 0.095, 0.001),
    "eta": (0.70, 0.005),
    **LINE,
}

MEMBRANE: Numbers = {
    "V": (50.0 * MILLILITRE, 0.0),
    "C0": _scaled(LH, 2.0, 0.3),
    "C1": _scaled(LH / RPM, 0.02, 0.002),
    "C2": _scaled(LH / BAR, 6.0, 0.2),
    "P0": (20.0, 0.5),
    "P1": _scaled(1.0 / RPM, 0.25, 0.003),
    "eta": (0.65, 0.005),
    **LINE,
}

CENTRIFUGAL: Numbers = {
    "n0": (2650.0 * RPM, 0.0),
    "h0": _scaled(BAR, 1.111, 0.002),
    "h1": _scaled(BAR / LH, 1.142e-4, 2.0e-6),
    "h2": _scaled(BAR / LH**2, 3.04e-7, 2.0e-9),
    "p0": (28.245, 0.1),
    "p1": _scaled(1.0 / LH, 0.03228, 3.0e-4),
    "p2": _scaled(1.0 / LH**2, 8.453e-6, 2.0e-7),
    **LINE,
}

METERED: Numbers = {
    "n0": (2650.0 * RPM, 0.0),
    "h0": _scaled(BAR, 1.111, 0.1),
    "h1": _scaled(BAR / LH, 1.142e-4, 1.0e-4),
    "h2": _scaled(BAR / LH**2, 3.04e-7, 1.0e-7),
    "p0": (28.245, 3.0),
    "p1": _scaled(1.0 / LH, 0.03228, 0.01),
    "p2": _scaled(1.0 / LH**2, 8.453e-6, 5.0e-6),
}

OIL_SET: Numbers = {
    "Q0": _scaled(LM, 9.0, 1.0),
    "C1": _scaled(LM / BAR, 0.008, 0.008),
    "P0": (200.0, 200.0),
    "P1": _scaled(1.0 / BAR, 14.5, 3.0),
}

OIL_WARM: Numbers = {
    **OIL_SET,
    "T0": (WARMED, 0.0),
    "b": (0.02, 0.02),
    "P2": (0.0, 10.0),
    "P3": _scaled(1.0 / BAR, 0.0, 0.1),
}

VALVE: Numbers = {"Kv": _scaled(1e3 * LH, 4.0, 0.8), "p_ref": (BAR, 0.0)}


def _cavity(p: Values, speed: Array, pressure: Array) -> tuple[Array, Array]:
    """Source: Wetterich 2025, Eq. 1; dp |dp| keeps the slip a loss when dp is negative."""
    free = (p["V"] - p["C1"]) * speed - p["C0"]
    return free, p["C2"] * pressure * np.abs(pressure)


def _membrane(p: Values, speed: Array, pressure: Array) -> tuple[Array, Array]:
    """Source: method.md, section 5."""
    return (p["V"] - p["C1"]) * speed - p["C0"], p["C2"] * pressure


def _centrifugal(p: Values, speed: Array, pressure: Array) -> tuple[Array, Array]:
    """Falling branch of the head curve; above shut-off nothing flows."""
    ratio = np.maximum(speed / p["n0"], 1e-9)
    root = p["h1"] ** 2 + 4.0 * p["h2"] * (p["h0"] - pressure / ratio**2)
    flow = ratio * (np.sqrt(np.maximum(root, 0.0)) - p["h1"]) / (2.0 * p["h2"])
    return flow, np.zeros_like(flow)


def _centrifugal_head(p: Values, speed: Array, flow: Array) -> Array:
    ratio = speed / p["n0"]
    return p["h0"] * ratio**2 - p["h1"] * ratio * flow - p["h2"] * flow**2


def _oil_set(p: Values, speed: Array, pressure: Array) -> tuple[Array, Array]:
    """Constant speed, laminar gaps."""
    return p["Q0"] * speed, p["C1"] * pressure


def _warm_set(p: Values, speed: Array, pressure: Array) -> tuple[Array, Array]:
    """The slip rises exponentially with the temperature. Source: Reynolds 1886."""
    return p["Q0"] * speed, p["C1"] * pressure * np.exp(p["b"] * (p["T"] - p["T0"]))


def _valve(p: Values, travel: Array, pressure: Array) -> tuple[Array, Array]:
    """Turbulent flow of water, proportional to the travel. Source: IEC 60534-2-1."""
    flow = p["Kv"] * travel * np.sqrt(np.maximum(pressure, 0.0) / p["p_ref"])
    return flow, np.zeros_like(flow)


def _no_power(p: Values, travel: Array, pressure: Array, flow: Array) -> Array:
    return np.zeros_like(travel)


def _displacement_power(p: Values, speed: Array, pressure: Array, flow: Array) -> Array:
    """Depends on the swept, not the delivered flow."""
    return p["P0"] + p["P1"] * speed + speed * p["V"] * pressure / p["eta"]


def _centrifugal_power(p: Values, speed: Array, pressure: Array, flow: Array) -> Array:
    ratio = speed / p["n0"]
    return ratio**3 * p["p0"] + ratio**2 * p["p1"] * flow - ratio * p["p2"] * flow**2


def _oil_power(p: Values, speed: Array, pressure: Array, flow: Array) -> Array:
    return p["P0"] + p["P1"] * pressure


def _warm_power(p: Values, speed: Array, pressure: Array, flow: Array) -> Array:
    warm = p["T"] - p["T0"]
    return p["P0"] + p["P1"] * pressure + p["P2"] * warm + p["P3"] * pressure * warm


PUMPS: Mapping[str, PumpKind] = {
    "cavity": PumpKind(
        "dosing-pcp", CAVITY, (400 * RPM, 1300 * RPM), 1.0, _cavity, _displacement_power
    ),
    "membrane": PumpKind(
        "dosing-membrane", MEMBRANE, (65 * RPM, 160 * RPM), 10.0, _membrane, _displacement_power
    ),
    "centrifugal": PumpKind(
        "dosing-centrifugal",
        CENTRIFUGAL,
        (2350 * RPM, 2950 * RPM),
        1.0,
        _centrifugal,
        _centrifugal_power,
        _centrifugal_head,
        rising=False,
    ),
    "metered": PumpKind(
        "metered-centrifugal",
        METERED,
        (1700 * RPM, 2950 * RPM),
        1.0,
        _centrifugal,
        _centrifugal_power,
        _centrifugal_head,
        rising=False,
    ),
    "oil-warm": PumpKind("pump-set-warm", OIL_WARM, (1.0, 1.0), 1.0, _warm_set, _warm_power),
    "valve": PumpKind("control-valve", VALVE, (0.0, 1.0), 1.0, _valve, _no_power),
    "oil-set": PumpKind("pump-set", OIL_SET, (1.0, 1.0), 1.0, _oil_set, _oil_power),
}
"""The speed of an oil set is constant, 1 of its own; that of a valve is its travel."""

MIXER: Numbers = {"k0": _scaled(BAR, 0.0, 0.0005), "k2": _scaled(BAR / LH**2, 3.5e-7, 1.5e-9)}
"""DN15, for about 1000 l/h; another size has another k2 with an uncertainty of 0.5 %."""
