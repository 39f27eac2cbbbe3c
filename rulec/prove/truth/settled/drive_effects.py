"""Physics of slip laws, drives and shafts that plain laws leave out."""

from __future__ import annotations

import numpy as np

from ..units import RPM, Array
from .effect import DISPLACEMENT, DOSING, Effect, Made, middle, quantile
from .scene import Scene
from .term import Reading, State, Term

HALVINGS = 40


def slip_power(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Gaps are less laminar than the law has it: a lower power of the pressure."""
    usual = middle(scene, scene.plain[f"{module}.dp"])
    more = -size

    def law(s: State) -> Array:
        return np.asarray(s.slip * ((np.maximum(s.pressure, 1.0) / usual) ** more - 1.0))

    return Made((Term("slip", module, law),), {"m": more})


def slip_dragged(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """The moving walls drag liquid against the slip, or with it, by a power of the speed."""
    usual = middle(scene, scene.given[f"{module}.n"])
    more = size * float(random.choice([-1.0, 1.0]))

    def law(s: State) -> Array:
        return np.asarray(s.slip * ((s.speed / usual) ** more - 1.0))

    return Made((Term("slip", module, law),), {"a": more})


def heated(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """What the pump dissipates warms the liquid in it beyond what the thermometer shows, K."""
    power = scene.plain[f"{module}.P_el"]
    colder = size * power / middle(scene, power)
    return Made((Reading(f"{module}.T", lambda shown: shown - colder),), {"r": size})


def induction(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """An asynchronous motor lags its field by so many revolutions at a torque, at any speed."""
    usual = middle(scene, scene.plain[f"{module}.dp"])
    lag = size * middle(scene, scene.given[f"{module}.n"])

    def law(s: State) -> Array:
        return np.asarray(lag * s.pressure / usual / s.speed)

    return Made((Term("shaft", module, law),), {"s": size})


def weakened(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Above the speed at which its voltage ends a motor slips more, with its square."""
    usual = middle(scene, scene.plain[f"{module}.dp"])
    limit = quantile(scene, scene.given[f"{module}.n"], float(random.uniform(0.4, 0.7)))

    def law(s: State) -> Array:
        beyond = np.maximum((s.speed / limit) ** 2 - 1.0, 0.0)
        return np.asarray(size * s.pressure / usual * beyond)

    return Made((Term("shaft", module, law),), {"s": size, "n_c": limit / RPM})


def folded_back(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Above a power the converter takes the speed back; the power is that at the lower speed."""
    limit = quantile(scene, scene.plain[f"{module}.P_el"], float(random.uniform(0.4, 0.8)))
    kind = scene.rig.kind(module)
    lead = f"{module}."
    own = {n.removeprefix(lead): v for n, v in scene.values.items() if n.startswith(lead)}

    def law(s: State) -> Array:
        low, high = np.zeros_like(s.speed), np.full_like(s.speed, 0.9)
        for _ in range(HALVINGS):
            share = 0.5 * (low + high)
            power = kind.power(own, s.speed * (1.0 - share), s.pressure, s.flow)
            more = size * np.maximum(power / limit - 1.0, 0.0) > share
            low, high = np.where(more, share, low), np.where(more, high, share)
        return np.asarray(0.5 * (low + high))

    return Made((Term("shaft", module, law),), {"s": size, "P_c": limit})


def stribeck(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Seals rub hard while no film carries them: a torque that dies away with the speed."""
    usual = middle(scene, scene.given[f"{module}.n"])
    load = middle(scene, scene.plain[f"{module}.P_el"])
    reach = float(random.uniform(0.15, 0.5)) * usual

    def law(s: State) -> Array:
        return np.asarray(size * load * s.speed / usual * np.exp(-s.speed / reach))

    return Made((Term("power", module, law),), {"e": reach / usual})


def power_speed(scene: Scene, module: str, size: float, random: np.random.Generator) -> Made:
    """Power that rises with another power of the speed than the affinity laws have it."""
    usual = middle(scene, scene.given[f"{module}.n"])
    more = size * float(random.choice([-1.0, 1.0]))

    def law(s: State) -> Array:
        return np.asarray(s.power * ((s.speed / usual) ** more - 1.0))

    return Made((Term("power", module, law),), {"a": more})


STROKES = ("cavity", "membrane")
EFFECTS = (
    Effect("slip-power", "slip by another power", "physics", 2e-3, 1.5, slip_power,
           kinds=DISPLACEMENT),
    Effect("slip-dragged", "slip by the speed", "physics", 2e-3, 1.5, slip_dragged, kinds=STROKES),
    Effect("heated", "liquid warmer than shown", "physics", 0.01, 40.0, heated,
           kinds=("oil-warm",)),
    Effect("induction", "motor slips with its torque", "physics", 1e-4, 0.15, induction,
           kinds=DOSING),
    Effect("weakened", "motor beyond its voltage", "physics", 1e-3, 0.2, weakened, kinds=STROKES,
           corner=True),
    Effect("folded-back", "converter limits the power", "physics", 1e-3, 0.8, folded_back,
           kinds=STROKES, corner=True),
    Effect("stribeck", "seals rub at low speed", "physics", 5e-3, 5.0, stribeck, kinds=STROKES),
    Effect("power-speed", "power by another power of speed", "physics", 2e-3, 1.8, power_speed,
           kinds=("centrifugal", "metered")),
)  # fmt: skip
