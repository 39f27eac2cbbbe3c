"""Plants as delivered: no parameter is exactly what the data sheet says."""

from collections.abc import Mapping

import numpy as np

from rulec.prove.truth.streams import factor
from tests.dosing import Plant

# Standard uncertainties as shares of the value. Source: the data sheets of the modules as printed
# (column u over value of kb/modules/dosing-pcp.yaml, dosing-centrifugal.yaml, static-mixer.yaml);
# the swept volume and the reference speed are exact there.
LINE = {"k0": 0.04, "k2": 0.0038}
MOTOR = {"P0": 0.02, "P1": 0.0105, "eta": 0.0071}
MODULES: Mapping[str, Mapping[str, float]] = {
    # A number is drawn for each part of the slip, also for one that a kind of pump does not have.
    "cavity": {**LINE, "C0": 0.083, "C1": 0.10, "linear": 0.05, "C2": 0.05, **MOTOR},
    "membrane": {**LINE, "C0": 0.083, "C1": 0.10, "C2": 0.05, "square": 0.05, **MOTOR},
    "centrifugal": {
        **LINE,
        **{"h0": 0.0018, "h1": 0.0175, "h2": 0.0066, "p0": 0.0035, "p1": 0.0093, "p2": 0.0237},
    },
}
MIXER_FRICTION = 0.0043


def drawn(plant: Plant, seed: int) -> Plant:
    """Return a plant of the same type, each parameter drawn within its uncertainty."""
    rig, factors = plant.rig, {}
    random = np.random.default_rng([seed, len(rig.pumps), len(rig.mixers)])
    for module, kind in rig.pumps.items():
        factors |= {f"{module}.{n}": factor(u, random) for n, u in MODULES[kind].items()}
    factors |= {f"{name}.k2": factor(MIXER_FRICTION, random) for name in rig.mixers}
    return plant.with_values({n: v * factors.get(n, 1.0) for n, v in plant.values.items()})
