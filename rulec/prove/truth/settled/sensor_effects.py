"""Sensor errors beyond the class, and plant faults that begin during the recording."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..units import BAR, Array
from .effect import DISPLACEMENT, DOSING, Effect, Here, Made, Make, span
from .term import Kind


def _follows(
    signal: str, shown: Callable[[Array, Array], Array], by: str, unit: float, name: str
) -> Make:
    """An error that follows the temperature (size per kelvin) or time (size at the end)."""

    def make(here: Here) -> Made:
        signed, scene = here.signed(), here.scene
        amount = signed * (here.warmer if by == "T" else scene.time / scene.length)
        factor = 1.0 if by == "T" else 1.0 / scene.days
        return here.reading(
            signal, lambda value: shown(value, amount), **{name: signed * factor / unit}
        )

    return make


def _offset(signal: str, unit: float) -> Make:
    def make(here: Here) -> Made:
        off = here.signed()
        return here.reading(signal, lambda v: v + off * unit, z=off)

    return make


def misadjusted(here: Here) -> Made:
    """A pressure transmitter has a wrong span (`size`), and a zero that compensates it in part."""
    gain = here.signed()
    zero = -gain * here.usual("dp") * here.between(0.3, 1.2)
    return here.reading("dp", lambda v: v * (1.0 + gain) + zero, x=gain, o=zero / BAR)


def two_slope(here: Here) -> Made:
    """Above a pressure, the gain of the transmitter is higher by the share `size`."""
    kink = here.limit("dp", 0.3, 0.7)
    values = {"b": here.size, "r_c": kink / BAR}
    return here.reading("dp", lambda v: v + here.size * np.maximum(v - kink, 0.0), **values)


def bent(here: Here) -> Made:
    """The error rises with the square of the distance from the usual pressure."""
    usual, reach = here.usual("dp"), 0.5 * span(here.scene, here.plain("dp"))
    values = {"b": here.size, "r0": usual / BAR, "w0": reach / BAR}
    return here.reading("dp", lambda v: v + here.size * (v - usual) ** 2 / reach, **values)


def speed_gain(here: Here) -> Made:
    """The converter shows a speed above or below that of the shaft."""
    off = here.signed()
    return here.reading("n", lambda v: v * (1.0 + off), x=off)


def _present(here: Here) -> Array:
    """1 while a fault is present: from a drawn time to the end, or for a while."""
    time, length = here.scene.time, here.scene.length
    begin = here.between(0.25, 0.6) * length
    # A fault that lasts to the end also lasts in a further recording.
    lasts = here.random.uniform() < 0.6
    end = math.inf if lasts else begin + here.between(0.15, 0.3) * length
    return ((time >= begin) & (time <= end)).astype(float)


def _fault(kind: Kind, sign: float) -> Make:
    def make(here: Here) -> Made:
        return here.constant(kind, sign * here.size * _present(here), x=here.size)

    return make


def _slope(signal: str, sign: float) -> Make:
    def make(here: Here) -> Made:
        factor = 1.0 + sign * here.size * _present(here)
        return here.reading(signal, lambda v: v * factor, x=here.size)

    return make


def _scaled(value: Array, amount: Array) -> Array:
    return np.asarray(value * np.exp(amount))


SENSORS = (
    Effect("dp-zero", "zero of the pressure off", 0.012, 0.5, _offset("dp", BAR), "sensor",
           kinds=DOSING),
    Effect("power-zero", "zero of the power off", 12.0, 120.0, _offset("P_el", 1.0), "sensor",
           kinds=DOSING),
    Effect("dp-misadjusted", "zero and span of the pressure off", 0.01, 0.6, misadjusted, "sensor",
           kinds=DOSING),
    Effect("dp-two-slope", "gain of the pressure changes at a value", 0.01, 2.0, two_slope,
           "sensor", kinds=DOSING, corner=True),
    Effect("dp-bent", "pressure not in proportion", 0.005, 0.2, bent, "sensor", kinds=DOSING),
    Effect("power-zero-creep", "zero of the power creeps", 0.1, 50.0,
           _follows("P_el", np.add, "t", 1.0, "z"), "sensor", timed=True, slow=True),
    Effect("speed-gain", "speed shown wrong", 0.01, 0.3, speed_gain, "sensor", kinds=DOSING),
    Effect("dp-zero-warm", "zero of the pressure follows temperature", 20.0, 4000.0,
           _follows("dp", np.add, "T", BAR, "z"), "sensor", kinds=DOSING, driver="T"),
    Effect("dp-gain-warm", "gain of the pressure follows temperature", 2e-5, 5e-3,
           _follows("dp", _scaled, "T", 1.0, "r"), "sensor", kinds=DOSING, driver="T"),
    Effect("dp-zero-creep", "zero of the pressure creeps", 300.0, 8e4,
           _follows("dp", np.add, "t", BAR, "z"), "sensor", kinds=DOSING, timed=True, slow=True),
    Effect("power-gain-creep", "gain of the power creeps", 2e-3, 0.4,
           _follows("P_el", _scaled, "t", 1.0, "r"), "sensor", timed=True, slow=True),
)  # fmt: skip

FAULTS = (
    Effect("leak", "bypass opens", 1e-3, 0.5, _fault("leak", 1.0), "fault", timed=True),
    Effect("clogged", "line clogs", 2e-3, 1.0, _fault("friction", 1.0), "fault", kinds=DOSING,
           timed=True),
    Effect("widened", "line washes out", 2e-3, 0.6, _fault("friction", -1.0), "fault",
           kinds=DOSING, timed=True),
    *(
        Effect(f"{name}-{word}", f"{signal} suddenly reads {word}", 1e-3, 0.5,
               _slope(signal, sign), "fault", kinds=kinds, timed=True)
        for signal, name, kinds in (
            ("dp", "dp", DOSING),
            ("P_el", "power", (*DISPLACEMENT, "centrifugal")),
        )
        for word, sign in (("high", 1.0), ("low", -1.0))
    ),
    Effect("mixer-clogged", "mixer clogs", 2e-3, 2.0, _fault("friction", 1.0), "fault",
           at="mixer", timed=True),
)  # fmt: skip

EFFECTS = (*SENSORS, *FAULTS)
