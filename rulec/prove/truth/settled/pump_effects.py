"""Physics of pumps and their motors that plain laws leave out."""

from __future__ import annotations

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, RPM
from .effect import DISPLACEMENT, DOSING, Effect, Made, middle, quantile, warmer
from .scene import Scene
from .term import Kind, Law, Term

MINUTE, DAY = 60.0, 86400.0


def _one(kind: Kind, module: str, law: Law, **parameters: float) -> Made:
    return Made((Term(kind, module, law),), parameters)


def slip_warm(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Laminar gaps: the slip follows the fluidity, which rises with the temperature."""
    rise = np.expm1(size * warmer(scene, module))
    return _one("slip", module, lambda s: s.slip * rise, b=size)


def slip_laminar(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Slip in proportion to the pressure; size in l/h/bar."""
    factor = size * LITRE_PER_HOUR / BAR
    return _one("slip", module, lambda s: factor * s.pressure, C=size)


def slip_gap(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Gaps widen with the pressure, and the slip with their cube; size per bar."""
    return _one(
        "slip", module, lambda s: s.slip * ((1.0 + size * s.pressure / BAR) ** 3 - 1.0), c=size
    )


def relief(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """A relief valve opens; size in l/h/bar."""
    opens = quantile(scene, scene.plain[f"{module}.dp"], float(random.uniform(0.7, 0.93)))
    factor = size * LITRE_PER_HOUR / BAR
    return _one(
        "slip",
        module,
        lambda s: factor * np.maximum(s.pressure - opens, 0.0),
        K=size,
        p_open=opens / BAR,
    )


def gas(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Gas in the liquid is compressed; inlet at 1 bar absolute."""
    return _one("gain", module, lambda s: size * s.pressure / (s.pressure + BAR), x=size)


def compressed(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The stroke is shortened by elastic parts; size per bar."""
    return _one("gain", module, lambda s: size * s.pressure / BAR, beta=size)


def valve_delay(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Valves close late in every stroke; size in ms."""
    return _one("gain", module, lambda s: 1e-3 * size * s.speed, tau=size)


def filling(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The pump does not fill above a speed."""
    limit = quantile(scene, scene.given[f"{module}.n"], float(random.uniform(0.65, 0.9)))
    return _one(
        "gain",
        module,
        lambda s: size * np.maximum(s.speed / limit - 1.0, 0.0),
        k=size,
        n_c=limit / RPM,
    )


def starved(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The pump draws air when its tank is nearly empty."""
    level = scene.level[module]
    limit = quantile(scene, level, float(random.uniform(0.15, 0.4)))
    share = np.maximum(1.0 - level / limit, 0.0)
    return _one("gain", module, lambda s: size * share, k=size, l_c=limit)


def belt(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Motor slip or a belt: the shaft turns slower under load; size at the median pressure."""
    usual = middle(scene, scene.plain[f"{module}.dp"])
    return _one("shaft", module, lambda s: size * s.pressure / usual, s=size)


def speed_limit(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The drive does not follow its set value above a speed."""
    shown = scene.given[f"{module}.n"]
    limit = quantile(scene, shown, float(random.uniform(0.65, 0.9)))
    share = size * np.maximum(shown - limit, 0.0) / shown
    return _one("shaft", module, lambda s: share, a=size, n_c=limit / RPM)


def warm_up_slip(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The cold pump slips less, or more, until it is warm."""
    constant = float(random.uniform(0.12, 0.4)) * scene.length
    sign = float(random.choice([-1.0, 1.0]))
    course = sign * size * np.exp(-scene.time / constant)
    return _one(
        "slip", module, lambda s: s.slip * course, a=sign * size, tau=constant * scene.pace / MINUTE
    )


def wear(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Gaps wear; size is the growth over the recording."""
    length = scene.length
    course = size * scene.time / length
    return _one("slip", module, lambda s: s.slip * course, w=size / scene.days)


def head_warm(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The head of a centrifugal pump rises as the liquid gets thinner."""
    factor = np.expm1(-size * warmer(scene, module))
    return _one("head", module, lambda s: s.pressure * factor, b=size)


def head_wear(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Head lost with time; size over the recording."""
    length = scene.length
    course = size * scene.time / length
    return _one("head", module, lambda s: s.pressure * course, w=size / scene.days)


def head_speed(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Head that rises with another power of the speed than 2."""
    ratio = scene.given[f"{module}.n"] / middle(scene, scene.given[f"{module}.n"])
    factor = ratio**-size - 1.0
    return _one("head", module, lambda s: s.pressure * factor, a=size)


def copper(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Copper loss by the square of the torque, so of the pressure; size at median load."""
    usual = middle(scene, scene.plain[f"{module}.dp"])
    load = middle(scene, scene.plain[f"{module}.P_el"])
    return _one("power", module, lambda s: size * load * (s.pressure / usual) ** 2, k=size)


def windage(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Fan of the motor, by the cube of the speed."""
    usual = middle(scene, scene.given[f"{module}.n"])
    load = middle(scene, scene.plain[f"{module}.P_el"])
    return _one("power", module, lambda s: size * load * (s.speed / usual) ** 3, k=size)


def viscous(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Viscous friction, by the square of the speed."""
    usual = middle(scene, scene.given[f"{module}.n"])
    load = middle(scene, scene.plain[f"{module}.P_el"])
    return _one("power", module, lambda s: size * load * (s.speed / usual) ** 2, k=size)


def power_warm(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """All power falls as the liquid gets warm."""
    factor = np.expm1(-size * warmer(scene, module))
    return _one("power", module, lambda s: s.power * factor, b=size)


def friction_warm(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Idle power falls as the liquid gets warm."""
    factor = np.expm1(-size * warmer(scene, module))
    return _one("power", module, lambda s: s.idle * factor, b=size)


def warm_up_power(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Cold bearings and seals take more until they are warm."""
    constant = float(random.uniform(0.12, 0.4)) * scene.length
    course = size * np.exp(-scene.time / constant)
    return _one(
        "power", module, lambda s: s.power * course, a=size, tau=constant * scene.pace / MINUTE
    )


STROKES = ("cavity", "membrane")
EFFECTS = (
    Effect("slip-warm", "slip follows the temperature", "physics", 1e-4, 0.08, slip_warm,
           kinds=DISPLACEMENT, driver="T"),
    Effect("slip-laminar", "slip linear in pressure", "physics", 0.02, 80, slip_laminar,
           kinds=("cavity",)),
    Effect("slip-gap", "gaps widen with pressure", "physics", 1e-4, 1.0, slip_gap,
           kinds=DISPLACEMENT),
    Effect("relief", "relief valve opens", "physics", 0.05, 2000, relief,
           kinds=DISPLACEMENT, corner=True),
    Effect("gas", "gas in the liquid", "physics", 1e-4, 0.3, gas, kinds=STROKES),
    Effect("compressed", "stroke shortened by pressure", "physics", 1e-5, 0.05, compressed,
           kinds=STROKES),
    Effect("valve-delay", "valves close late", "physics", 0.05, 60, valve_delay,
           kinds=("membrane",)),
    Effect("filling", "does not fill at high speed", "physics", 1e-3, 2.5, filling,
           kinds=STROKES, corner=True),
    Effect("starved", "draws air at low level", "physics", 1e-3, 0.6, starved,
           kinds=DOSING, driver="l", corner=True),
    Effect("belt", "shaft slower under load", "physics", 1e-4, 0.15, belt, kinds=STROKES),
    Effect("speed-limit", "drive does not follow", "physics", 5e-3, 1.0, speed_limit,
           kinds=DOSING, corner=True),
    Effect("warm-up-slip", "slip until warm", "physics", 5e-3, 0.9, warm_up_slip,
           kinds=DISPLACEMENT, timed=True),
    Effect("wear", "slip grows with time", "physics", 5e-3, 3.0, wear, kinds=DISPLACEMENT,
           timed=True, slow=True),
    Effect("head-warm", "head rises with temperature", "physics", 1e-5, 0.02, head_warm,
           kinds=("centrifugal",), driver="T"),
    Effect("head-wear", "head lost with time", "physics", 2e-4, 0.3, head_wear,
           kinds=("centrifugal",), timed=True, slow=True),
    Effect("head-speed", "head not by the square of speed", "physics", 1e-3, 0.8, head_speed,
           kinds=("centrifugal",)),
    Effect("copper", "copper loss", "physics", 1e-3, 0.6, copper, kinds=DISPLACEMENT),
    Effect("windage", "fan of the motor", "physics", 1e-3, 0.8, windage, kinds=DOSING),
    Effect("viscous", "viscous friction", "physics", 1e-3, 0.8, viscous, kinds=DOSING),
    Effect("power-warm", "power falls with temperature", "physics", 1e-5, 0.02, power_warm,
           driver="T"),
    Effect("friction-warm", "idle power falls with temperature", "physics", 1e-4, 0.06,
           friction_warm, kinds=DISPLACEMENT, driver="T"),
    Effect("warm-up-power", "more power until warm", "physics", 1e-3, 0.6, warm_up_power,
           timed=True),
)  # fmt: skip
