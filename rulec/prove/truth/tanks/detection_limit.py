"""The limit of detection of each planted effect. Difficulties of hard cases count as known."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..detection_limit import expected_gain
from ..units import Array
from .build import CARD_ZERO, LITRE_PER_HOUR, METER_SLOPE, Setup
from .effect_size import Planted, Readings, change_of, run
from .plant import LEVEL_ZERO, SENSOR, Numbers
from .sensing import shown

MOVED: Mapping[str, Mapping[str, float]] = {
    "tank": {"area": 1.0, "outlet": 0.04, "start": 8.0},
    "sensor": {"gain": 0.2, "zero": math.hypot(0.5, LEVEL_ZERO)},
    "meter": {"gain": METER_SLOPE * LITRE_PER_HOUR},
    "pump": {"gain": 2.0, "zero": CARD_ZERO},
}
"""Standard uncertainties: in `open-tank`, cm2, cm2, cm; of a level transmitter, V/cm and V, whose
zero combines that of the module type and its class; of a flow meter; of `voltage-pump` and its
output card, cm3/s/V and V."""

STEP = 0.01
"""Share of an uncertainty by which a parameter is moved for its derivative."""


def gains(setup: Setup, planted: Sequence[Planted]) -> list[float]:
    """Return the expected gain of each planted effect while the others may have any size.

    All is linear at the plant without effects: changes and derivatives must be taken at one point,
    or the difference between two points could pass for any effect. A large effect that parameters
    compensate along a curve therefore seems more detectable than it is.
    """
    if not planted:
        return []
    plant, layout = setup.plant, setup.layout
    plain = shown(plant, setup.course)

    def over_noise(change: Readings) -> Array:
        return np.concatenate([change[tank] / noise_of(s) for tank, s in plant.sensors.items()])

    # Each parameter that the model may fit, higher by STEP of its uncertainty
    kinds = {layout.feed: "meter" if layout.metered else "pump"}
    kinds |= dict.fromkeys(layout.tanks, "tank")
    kinds |= {f"{tank}{SENSOR}": "sensor" for tank in layout.measured}
    slopes = []
    for part, kind in kinds.items():
        for name, u in MOVED[kind].items():
            moved = plant.with_(part, **{name: plant.parts[part][name] + STEP * u})
            readings = shown(moved, run(setup, moved))
            slopes.append(over_noise(change_of(readings, plain)) / STEP)
    alone = [over_noise(one.change) for one in planted]
    found = []
    for i, own in enumerate(alone):
        others = np.array([*alone[:i], *alone[i + 1 :]]).reshape(-1, own.size).T
        found.append(expected_gain(own, np.column_stack(slopes), others))
    return found


def noise_of(sensor: Numbers) -> float:
    """Return the standard deviation of a reading, V: white noise and steps of the converter.

    A step is uniform, GUM 4.3.7; coarse steps are an effect instead.
    """
    return math.hypot(sensor["noise"], sensor["converter"] / math.sqrt(12.0))
