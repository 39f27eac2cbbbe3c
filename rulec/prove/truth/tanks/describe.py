"""What the answer of a case says, from the plant and what was planted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..sealed import verdict_of
from .answer import Answer, Truth
from .build import LITRE_PER_HOUR, METER_NOISE, UNITS, Setup
from .effect import Values
from .effects import SENSOR
from .size import Planted, Readings, rms

NOISE = 0.03
"""V; a larger change is present."""


def describe(
    label: str,
    seed: int,
    attempt: int,
    setup: Setup,
    planted: Sequence[Planted],
    change: Readings,
    hiding: float | None,
) -> Answer:
    """The answer; `change` is what all effects change together, by tank."""
    truths = tuple(_truth(one) for one in planted)
    return Answer(
        label,
        setup.layout.name,
        seed,
        attempt,
        setup.time.size,
        setup.layout.interval,
        setup.profile,
        verdict_of([t.sort for t in truths]),
        truths,
        parameters(setup),
        _sensing(setup),
        _by_signal(change),
        hiding,
    )


def parameters(setup: Setup) -> dict[str, tuple[float, str]]:
    """True base parameters; the gain of a sensor that is not there is left out."""
    plant, layout = setup.plant, setup.layout
    found = {} if layout.metered else {f"{layout.feed}.k": (plant.feed.gain, UNITS["k"])}
    for tank in plant.tanks:
        found[f"{tank.name}.A"] = tank.area, UNITS["A"]
        found[f"{tank.name}.a"] = tank.outlet, UNITS["a"]
        found[f"{tank.name}.h0"] = tank.level, UNITS["h0"]
    for sensor in plant.sensors:
        found[f"{sensor.tank}.g"] = sensor.gain, UNITS["g"]
    return found


def _truth(one: Planted) -> Truth:
    effect = one.placed.effect
    seen = [np.abs(values) > NOISE for values in one.change.values()]
    return Truth(
        effect.name,
        effect.title,
        effect.sort,
        one.placed.module,
        one.built.values,
        one.built.period,
        _by_signal(one.change),
        float(np.mean(np.any(seen, axis=0))),
        effect.twins,
    )


def _by_signal(change: Readings) -> dict[str, float]:
    """Root mean square by signal; less than 0.05 mV is the solver's."""
    return {f"{tank}{SENSOR}": round(rms(values), 4) for tank, values in change.items()}


def _sensing(setup: Setup) -> Values:
    """What the instruments of a healthy plant do as well."""
    feed, found = setup.plant.feed, {}
    if setup.layout.metered:
        found[f"{feed.name}.Q.slope"] = feed.gain / LITRE_PER_HOUR - 1.0, "1"
        found[f"{feed.name}.Q.noise"] = METER_NOISE, "1"
    else:
        found[f"{feed.name}.u.zero"] = feed.zero, "V"
    for sensor in setup.plant.sensors:
        found[f"{sensor.tank}{SENSOR}.zero"] = sensor.zero, "V"
        found[f"{sensor.tank}{SENSOR}.noise"] = sensor.noise, "V"
        found[f"{sensor.tank}{SENSOR}.converter"] = sensor.converter, "V"
    return found
