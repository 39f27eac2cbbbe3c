"""What the truth's laws leave out: pumps that stand or run dry, a liquid that gets cold."""

from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.prove.truth.settled.solve import Operated, State, Term
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR
from tests.dosing.plant import LIQUID_TEMPERATURE, Plant

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


def idle(plant: Plant, name: str, when: Array, back: float = SHUT) -> Plant:
    """Return the plant with a pump that does not pump for a while: off, or dry.

    Parameters
    ----------
    when : shape (n,), bool; when it does not, and is a passage instead: dp = -back Q |Q|
    back : Pa/(m3/s)2; of a check valve, `SHUT`
    """
    kind, own = plant.rig.kind(name), Operated(plant.rig, plant.values, {}).parameters(name)

    def passage(s: State) -> Array:
        through = -np.sign(s.pressure) * np.sqrt(np.abs(s.pressure) / back)
        return np.where(when, through, np.nan)

    def power(s: State) -> Array:
        """Of a dry pump that of friction alone, of one that is off none."""
        none = np.zeros_like(s.flow)
        dry = kind.power(own, s.speed, none, none) * (DRY_POWER if kind.by_head else 1.0)
        return np.where(when, dry * (s.speed > 0.0) - s.power, 0.0)

    return replace(
        plant, terms=(*plant.terms, Term("passage", name, passage), Term("power", name, power))
    )


SLIP = (".C0", ".C1", ".C2")
"""Ends of the names of what a displacement pump's slip has as parameters."""


def scaled(plant: Plant, ends: tuple[str, ...], factor: Array) -> Plant:
    """The plant with parameters times a factor, shape (n,), by the ends of their names."""
    return plant.with_values({n: v * factor for n, v in plant.values.items() if n.endswith(ends)})


def everywhere(plant: Plant, friction: Array) -> dict[str, Array]:
    """More friction (a share, shape (n,)) in all lines and mixers, as faults of the truth."""
    more, less = np.maximum(friction, 0.0), np.maximum(-friction, 0.0)
    names = [*plant.rig.pumps, *plant.rig.mixers]
    found = {f"{name}.clogging": more for name in names}
    return found | ({f"{name}.widening": less for name in names} if less.any() else {})


def water_at(plant: Plant, temperature: Array) -> tuple[Plant, dict[str, Array]]:
    """The plant with water of some temperature, K: slip follows 1/viscosity, friction Blasius."""
    thicker = np.exp(-VISCOSITY_PER_KELVIN * (temperature - LIQUID_TEMPERATURE))
    return scaled(plant, SLIP, 1.0 / thicker), everywhere(plant, thicker**BLASIUS - 1.0)
