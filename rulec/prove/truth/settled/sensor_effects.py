"""Sensors that err beyond their class, and plant faults that begin while the recording runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from ..units import BAR, Array
from .effect import DISPLACEMENT, DOSING, Effect, Made, Make, middle, quantile, span, warmer
from .scene import Scene
from .term import Kind, Reading, Term


def _follows(
    signal: str, shown: Callable[[Array, Array], Array], by: str, unit: float, name: str
) -> Make:
    """A reading whose error follows the temperature (size per kelvin) or time (size at the end)."""

    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        sign = float(random.choice([-1.0, 1.0]))
        length = scene.length
        course = warmer(scene, module) if by == "T" else scene.time / length
        amount = sign * size * course
        reading = Reading(f"{module}.{signal}", lambda value: shown(value, amount))
        factor = 1.0 if by == "T" else 1.0 / scene.days
        return Made((reading,), {name: sign * size * factor / unit})

    return make


def _offset(signal: str, unit: float, name: str = "z") -> Make:
    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        off = float(random.choice([-1.0, 1.0])) * size
        return Made((Reading(f"{module}.{signal}", lambda v: v + off * unit),), {name: off})

    return make


def misadjusted(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A pressure transmitter with wrong span (`size`) and a zero that makes up for it in part.

    `z` is what it reads too much at its median reading.
    """
    gain = float(random.choice([-1.0, 1.0])) * size
    true = middle(scene, scene.plain[f"{module}.dp"])
    zero = -gain * true * float(random.uniform(0.3, 1.2))

    def shown(value: Array) -> Array:
        return value * (1.0 + gain) + zero

    return Made((Reading(f"{module}.dp", shown),), {"x": gain, "o": zero / BAR})


def two_slope(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Above a pressure the transmitter shows each further one larger by the share `size`."""
    kink = quantile(scene, scene.plain[f"{module}.dp"], float(random.uniform(0.3, 0.7)))

    def shown(value: Array) -> Array:
        return value + size * np.maximum(value - kink, 0.0)

    return Made((Reading(f"{module}.dp", shown),), {"b": size, "r_c": kink / BAR})


def bent(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """What is shown too much rises with the square of the distance from the usual pressure."""
    values = scene.plain[f"{module}.dp"]
    usual, reach = middle(scene, values), 0.5 * span(scene, values)

    def shown(value: Array) -> Array:
        return value + size * (value - usual) ** 2 / reach

    own = Reading(f"{module}.dp", shown)
    return Made((own,), {"b": size, "r0": usual / BAR, "w0": reach / BAR})


def speed_gain(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The converter shows more or less than the shaft turns."""
    off = float(random.choice([-1.0, 1.0])) * size
    return Made((Reading(f"{module}.n", lambda v: v * (1.0 + off)),), {"x": off})


def _present(scene: Scene, random: np.random.Generator) -> Array:
    """1 while a fault is there: from a third on, to the end or for a while."""
    length = scene.length
    begin = float(random.uniform(0.25, 0.6)) * length
    # What lasts to the end lasts on where the plant is recorded further.
    lasts = random.uniform() < 0.6
    end = math.inf if lasts else begin + float(random.uniform(0.15, 0.3)) * length
    return ((scene.time >= begin) & (scene.time <= end)).astype(float)


def _fault(kind: Kind, sign: float) -> Make:
    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        course = sign * size * _present(scene, random)
        return Made((Term(kind, module, lambda s: course),), {"x": size})

    return make


def _slope(signal: str, sign: float) -> Make:
    def make(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
        factor = 1.0 + sign * size * _present(scene, random)
        return Made((Reading(f"{module}.{signal}", lambda v: v * factor),), {"x": size})

    return make


def _added(value: Array, amount: Array) -> Array:
    return value + amount


def _scaled(value: Array, amount: Array) -> Array:
    return np.asarray(value * np.exp(amount))


def _effects() -> Iterator[Effect]:
    yield Effect("dp-zero", "zero of the pressure off", "sensor", 0.012, 0.5, _offset("dp", BAR),
                 kinds=DOSING)  # fmt: skip
    yield Effect("power-zero", "zero of the power off", "sensor", 12.0, 120.0, _offset("P_el", 1.0),
                 kinds=DOSING)  # fmt: skip
    yield Effect("dp-misadjusted", "zero and span of the pressure off", "sensor", 0.01, 0.6,
                 misadjusted, kinds=DOSING)  # fmt: skip
    yield Effect("dp-two-slope", "gain of the pressure changes at a value", "sensor", 0.01, 2.0,
                 two_slope, kinds=DOSING, corner=True)  # fmt: skip
    yield Effect("dp-bent", "pressure not in proportion", "sensor", 0.005, 0.2, bent,
                 kinds=DOSING)  # fmt: skip
    yield Effect("power-zero-creep", "zero of the power creeps", "sensor", 0.1, 50.0,
                 _follows("P_el", _added, "t", 1.0, "z"), timed=True, slow=True)  # fmt: skip
    yield Effect("speed-gain", "speed shown wrong", "sensor", 0.01, 0.3, speed_gain, kinds=DOSING)
    yield Effect("dp-zero-warm", "zero of the pressure follows temperature", "sensor", 20.0, 4000.0,
                 _follows("dp", _added, "T", BAR, "z"), kinds=DOSING, driver="T")  # fmt: skip
    yield Effect("dp-gain-warm", "gain of the pressure follows temperature", "sensor", 2e-5, 5e-3,
                 _follows("dp", _scaled, "T", 1.0, "r"), kinds=DOSING, driver="T")  # fmt: skip
    yield Effect("dp-zero-creep", "zero of the pressure creeps", "sensor", 300.0, 8e4,
                 _follows("dp", _added, "t", BAR, "z"), kinds=DOSING, timed=True,
                 slow=True)  # fmt: skip
    yield Effect("power-gain-creep", "gain of the power creeps", "sensor", 2e-3, 0.4,
                 _follows("P_el", _scaled, "t", 1.0, "r"), timed=True, slow=True)  # fmt: skip
    yield Effect("leak", "bypass opens", "fault", 1e-3, 0.5, _fault("leak", 1.0), timed=True)
    yield Effect("clogged", "line clogs", "fault", 2e-3, 1.0, _fault("friction", 1.0), kinds=DOSING,
                 timed=True)  # fmt: skip
    yield Effect("widened", "line washes out", "fault", 2e-3, 0.6, _fault("friction", -1.0),
                 kinds=DOSING, timed=True)  # fmt: skip
    for signal in ("dp", "P_el"):
        for word, sign in (("high", 1.0), ("low", -1.0)):
            name = f"{'power' if signal == 'P_el' else 'dp'}-{word}"
            kinds = DOSING if signal == "dp" else (*DISPLACEMENT, "centrifugal")
            yield Effect(name, f"{signal} suddenly reads {word}", "fault", 1e-3, 0.5,
                         _slope(signal, sign), kinds=kinds, timed=True)  # fmt: skip
    yield Effect("mixer-clogged", "mixer clogs", "fault", 2e-3, 2.0, _fault("friction", 1.0),
                 at="mixer", timed=True)  # fmt: skip


EFFECTS = tuple(_effects())
