"""Difficulties beyond the plain laws of a case of tanks: form errors, coloured noise, drifts,
starts at any level.

They belong to the plant or its sensors, and none of them is an effect to be found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..smooth import Drift, drift, form_error
from ..streams import stream
from .form_error import Bend
from .plant import Plant, Tank

FORM = 0.005, 0.02
"""Root mean square of a law's form error, smallest and largest."""

COLOUR = 0.5, 0.9
"""Coefficient of first-order noise at the sample rate, smallest and largest."""

STARTS = 1.0, 25.0
"""Lowest and highest first level, cm; the first reading is at most HIGHEST."""

HIGHEST = 8.0
"""V"""

ABOVE = 1.3
"""Range of a law over its value at the largest settled flow."""

Told = Mapping[str, Mapping[str, float]]
"""The difficulties in the sealed answer: sizes by law or sensor."""


@dataclass(frozen=True)
class Meter:
    """Errors of a flow meter: coefficient of its noise, and its drift."""

    colour: float = 0.0
    wander: Drift | None = None


@dataclass(frozen=True)
class Hardened:
    """A plant with its difficulties."""

    plant: Plant
    meter: Meter
    told: Told


def hardened(
    plant: Plant,
    names: Sequence[str],
    seed: int,
    ranges: Mapping[str, float],
    metered: bool,
) -> Hardened:
    """Draw the named difficulties; `ranges` has the largest settled level of each tank, cm, and the
    largest input of a pump, V, by its name."""
    told: dict[str, dict[str, float]] = {}
    if "form" in names:
        bends = {
            law: _bend(seed, law, ABOVE * most)
            for law, most in ranges.items()
            if law != plant.feed.name or not metered
        }
        told["form"] = {law: bend.rms for law, bend in bends.items()}
        plant = replace(
            plant,
            feed=replace(plant.feed, form=bends.get(plant.feed.name)),
            tanks=tuple(replace(tank, form=bends[tank.name]) for tank in plant.tanks),
        )
    sensors = [s.tank for s in plant.sensors] + [plant.feed.name] * metered
    if "coloured" in names:
        told["coloured"] = {
            place: float(stream(seed, f"colour {place}").uniform(*COLOUR)) for place in sensors
        }
    wanders: dict[str, Drift] = {}
    if "drift" in names:
        wanders = {place: drift(stream(seed, f"drift {place}")) for place in sensors}
        told["drift"] = {place: one.extent for place, one in wanders.items()}
    colours = told.get("coloured", {})
    meter = Meter(colours.get(plant.feed.name, 0.0), wanders.get(plant.feed.name))
    plant = replace(
        plant,
        sensors=tuple(
            replace(s, colour=colours.get(s.tank, 0.0), wander=wanders.get(s.tank))
            for s in plant.sensors
        ),
    )
    if "starts" in names:
        tanks = tuple(_begun(plant, tank, seed) for tank in plant.tanks)
        told["starts"] = {tank.name: tank.level for tank in tanks}
        plant = replace(plant, tanks=tanks)
    return Hardened(plant, meter, told)


def _bend(seed: int, law: str, most: float) -> Bend:
    random = stream(seed, f"form {law}")
    rms = math.exp(random.uniform(*np.log(FORM)))
    return Bend.of(form_error(random, rms, ((0.0, most),)))


def _begun(plant: Plant, tank: Tank, seed: int) -> Tank:
    level = float(stream(seed, f"start {tank.name}").uniform(*STARTS))
    most = [HIGHEST / s.gain for s in plant.sensors if s.tank == tank.name]
    return replace(tank, level=min([level, *most]))
