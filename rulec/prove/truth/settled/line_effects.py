"""Physics of lines and mixers that plain laws leave out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, Array
from .effect import DOSING, Effect, Made, middle, warmer
from .pump_effects import MINUTE
from .scene import Scene
from .term import State, Term

ROUNDS = 30
"""In which a hose and the pressure in it settle."""


def laminar(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A part of the loss in proportion to the flow; size is the flow, l/h, of equal parts."""
    factor = scene.values[f"{module}.k2"] * size * LITRE_PER_HOUR
    return Made((Term("loss", module, lambda s: factor * s.flow),), {"a": size})


def exponent(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Loss by a lower power of the flow than 2: 2 - size, the same at the middle."""
    usual = middle(scene, _flow(scene, module))
    friction = scene.values[f"{module}.k2"]

    def law(flow: Array) -> Array:
        own = np.maximum(np.abs(flow), 1e-3 * usual)
        return np.asarray(friction * flow * own * ((own / usual) ** -size - 1.0))

    return Made((Term("loss", module, lambda s: law(s.flow)),), {"power": 2.0 - size})


def line_warm(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Friction falls as the liquid gets thinner."""
    factor = np.expm1(-2.0 * size * warmer(scene, module))
    return Made((Term("friction", module, lambda s: factor),), {"b": size})


def static_head(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The level of the feed tank lifts or lowers what the pump works against; bar per m."""
    level = scene.level[module]
    height = BAR * size * (level - middle(scene, level))
    return Made((Term("loss", module, lambda s: height),), {"w": size})


def fouling(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Friction grows with time; size over the recording."""
    length = scene.length
    course = size * scene.time / length
    return Made((Term("friction", module, lambda s: course),), {"w": size / scene.days})


def worn(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A throttle wears and lets more through, at the end by the share `size` of the flow."""
    length = scene.length
    course = (1.0 + size * scene.time / length) ** -2 - 1.0
    return Made((Term("friction", module, lambda s: course),), {"w": size / scene.days})


def transition(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Below a flow, `size` times the usual one, the loss is laminar: it is linear in the flow."""
    limit = size * middle(scene, _flow(scene, module))
    friction = scene.values[f"{module}.k2"]

    def law(flow: Array) -> Array:
        return np.asarray(friction * flow * np.maximum(limit - np.abs(flow), 0.0))

    values = {"p_t": friction * limit**2 / BAR}
    return Made((Term("loss", module, lambda s: law(s.flow)),), values)


def hose(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A hose widens under the pressure at the pump; size as share of the flow per bar."""
    static, friction = (scene.values[f"{module}.{name}"] for name in ("k0", "k2"))

    def law(s: State) -> Array:
        factor = np.ones_like(s.flow)
        for _ in range(ROUNDS):
            pressure = s.pressure + static + friction * factor * s.flow * np.abs(s.flow)
            factor = (1.0 + size * np.maximum(pressure, 0.0) / BAR) ** -2
        return np.asarray(factor - 1.0)

    return Made((Term("friction", module, law),), {"c": size})


def settling(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The line passes more at the start, until deposits have settled; size as share of flow."""
    constant = float(random.uniform(0.12, 0.4)) * scene.length
    course = (1.0 + size * np.exp(-scene.time / constant)) ** -2 - 1.0
    parameters = {"a": size, "tau": constant * scene.pace / MINUTE}
    return Made((Term("friction", module, lambda s: course),), parameters)


def _flow(scene: Scene, module: str) -> Array:
    """Flow through a line, or through a mixer."""
    if module in scene.rig.pumps:
        return scene.plain[f"{module}.Q"]
    feeding = [n for n in scene.rig.pumps if module in scene.rig.path(n)]
    return np.asarray(np.sum([scene.plain[f"{n}.Q"] for n in feeding], axis=0))


def _effects() -> Iterator[Effect]:
    yield Effect("static-head", "level of the feed tank", "physics", 1e-3, 0.11, static_head,
                 kinds=DOSING, driver="l")  # fmt: skip
    yield Effect("settling", "line passes more at first", "physics", 1e-4, 0.3, settling,
                 kinds=DOSING, timed=True)  # fmt: skip
    yield Effect("laminar", "laminar part of the loss", "physics", 0.2, 900, laminar, kinds=DOSING)
    yield Effect("exponent", "loss with a lower power", "physics", 2e-3, 0.6, exponent,
                 kinds=DOSING)  # fmt: skip
    yield Effect("line-warm", "friction falls when warm", "physics", 1e-5, 0.02, line_warm,
                 kinds=DOSING, driver="T")  # fmt: skip
    yield Effect("fouling", "friction grows with time", "physics", 2e-4, 0.8, fouling, kinds=DOSING,
                 timed=True, slow=True)  # fmt: skip
    yield Effect("worn", "throttle wears", "physics", 2e-4, 0.5, worn, kinds=DOSING,
                 timed=True, slow=True)  # fmt: skip
    yield Effect("hose", "hose widens", "physics", 1e-4, 0.3, hose, kinds=DOSING)
    for name, title, low, high, make in (
        ("mixer-laminar", "laminar part of the mixer", 0.2, 3000, laminar),
        ("mixer-exponent", "mixer's loss with a lower power", 2e-3, 0.6, exponent),
        ("mixer-transition", "mixer laminar below a flow", 0.5, 2.5, transition),
        ("mixer-fouling", "mixer fouls with time", 2e-4, 1.5, fouling),
    ):
        timed, corner = make is fouling, make is transition
        yield Effect(
            name, title, "physics", low, high, make, at="mixer",
            timed=timed, slow=timed, corner=corner,
        )  # fmt: skip


EFFECTS = tuple(_effects())
