"""The limit of detection of each planted effect. Difficulties of hard cases count as known."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ..detection_limit import expected_gain
from ..units import Array
from .build import CARD_ZERO, LITRE_PER_HOUR, METER_SLOPE, Setup
from .effect_size import Planted, Readings, change_of, run
from .plant import LEVEL_ZERO, SENSOR, Numbers, Plant
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
    plain = shown(setup.plant, setup.course)
    moved = (shown(plant, run(setup, plant)) for plant in _moved(setup.plant))
    slopes = [_over_noise(setup, change_of(readings, plain)) / STEP for readings in moved]
    alone = [_over_noise(setup, one.change) for one in planted]
    found = []
    for i, own in enumerate(alone):
        others = np.array([*alone[:i], *alone[i + 1 :]]).reshape(-1, own.size).T
        found.append(expected_gain(own, np.column_stack(slopes), others))
    return found


def _moved(plant: Plant) -> Iterator[Plant]:
    """The plant with each parameter that its model may fit higher by STEP of its uncertainty."""
    layout = plant.layout
    kinds = {
        layout.feed: "meter" if layout.metered else "pump",
        **dict.fromkeys(layout.tanks, "tank"),
    }
    kinds |= {f"{tank}{SENSOR}": "sensor" for tank in layout.measured}
    for part, kind in kinds.items():
        for name, u in MOVED[kind].items():
            yield plant.with_(part, **{name: plant.parts[part][name] + STEP * u})


def _over_noise(setup: Setup, change: Readings) -> Array:
    """Changes of all readings over their noise, sensor by sensor, shape (n,), 1."""
    return np.concatenate([change[tank] / noise_of(s) for tank, s in setup.plant.sensors.items()])


def noise_of(sensor: Numbers) -> float:
    """Return the standard deviation of a reading, V: white noise and steps of the converter.

    A step is uniform, GUM 4.3.7; coarse steps are an effect instead.
    """
    return math.hypot(sensor["noise"], sensor["converter"] / math.sqrt(12.0))
