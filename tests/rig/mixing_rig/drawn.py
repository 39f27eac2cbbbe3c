"""Plants as delivered: no parameter is exactly what the data sheet says."""

from dataclasses import replace

import numpy as np

from rulec.prove.truth.plant import DosingModule, Line, Mixer, Plant
from rulec.prove.truth.pumps import Centrifugal, Displacement, Pump
from rulec.prove.truth.streams import factor

# Standard uncertainties as shares of the value. Source: the data sheets of the modules as printed
# (column u over value of kb/modules/dosing-pcp.yaml, dosing-centrifugal.yaml, static-mixer.yaml);
# the swept volume and the reference speed are exact there.
DISPLACEMENT = {
    "slip": 0.083,
    "slip_per_speed": 0.10,
    "slip_linear": 0.05,
    "slip_quadratic": 0.05,
    "idle_power": 0.02,
    "power_per_speed": 0.0105,
    "efficiency": 0.0071,
}
HEAD = (0.0018, 0.0175, 0.0066)
ELECTRIC = (0.0035, 0.0093, 0.0237)
STATIC_LOSS, LINE_FRICTION, MIXER_FRICTION = 0.04, 0.0038, 0.0043


def drawn(plant: Plant, seed: int) -> Plant:
    """Return a plant of the same type, each parameter drawn within its uncertainty."""
    random = np.random.default_rng([seed, len(plant.modules), len(plant.mixers)])
    modules = {name: _module(module, random) for name, module in plant.modules.items()}
    mixers = {
        name: Mixer(mixer.quadratic * factor(MIXER_FRICTION, random))
        for name, mixer in plant.mixers.items()
    }
    return Plant(modules, mixers, plant.downstream)


def _module(module: DosingModule, random: np.random.Generator) -> DosingModule:
    line = Line(
        module.line.static * factor(STATIC_LOSS, random),
        module.line.quadratic * factor(LINE_FRICTION, random),
    )
    return replace(module, pump=_pump(module.pump, random), line=line)


def _pump(pump: Pump, random: np.random.Generator) -> Pump:
    match pump:
        case Displacement():
            changed = {
                name: getattr(pump, name) * factor(u, random) for name, u in DISPLACEMENT.items()
            }
            return replace(pump, **changed)
        case Centrifugal():
            h0, h1, h2 = (v * factor(u, random) for v, u in zip(pump.head, HEAD, strict=True))
            p0, p1, p2 = (
                v * factor(u, random) for v, u in zip(pump.electric, ELECTRIC, strict=True)
            )
            return replace(pump, head=(h0, h1, h2), electric=(p0, p1, p2))
    raise TypeError(f"no spread known for {pump}")
