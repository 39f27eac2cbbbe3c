"""Difficulties beyond the plain laws of a case of tanks: form errors, coloured noise, drifts,
starts at any level.

They belong to the plant or its sensors, and none of them is an effect to be found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ..smooth import Drift, colours, drifts, form_errors
from ..streams import stream
from .feed import Bend
from .plant import Plant, Tank

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


def hardened(
    plant: Plant, names: Sequence[str], seed: int, ranges: Mapping[str, float], metered: bool
) -> tuple[Plant, Meter, Told]:
    """Draw the named difficulties; `ranges` has the largest settled level of each tank, cm, and the
    largest input of a pump, V, by its name."""
    told: dict[str, dict[str, float]] = {}
    feed = plant.feed.name
    if "form" in names:
        laws = (
            (law, ((0.0, ABOVE * ranges[law]),)) for law in ranges if law != feed or not metered
        )
        forms = {law: Bend.of(form) for law, form in form_errors(seed, laws).items()}
        told["form"] = {law: bend.rms for law, bend in forms.items()}
        tanks = tuple(replace(tank, form=forms[tank.name]) for tank in plant.tanks)
        plant = replace(plant, feed=replace(plant.feed, form=forms.get(feed)), tanks=tanks)
    places = [s.tank for s in plant.sensors] + [feed] * metered
    noise = colours(seed, places) if "coloured" in names else {}
    wander = drifts(seed, places) if "drift" in names else {}
    told |= {"coloured": noise} if noise else {}
    told |= {"drift": {place: one.extent for place, one in wander.items()}} if wander else {}
    sensors = (
        replace(s, colour=noise.get(s.tank, 0.0), wander=wander.get(s.tank)) for s in plant.sensors
    )
    plant = replace(plant, sensors=tuple(sensors))
    if "starts" in names:
        plant = replace(plant, tanks=tuple(_begun(plant, tank, seed) for tank in plant.tanks))
        told["starts"] = {tank.name: tank.level for tank in plant.tanks}
    return plant, Meter(noise.get(feed, 0.0), wander.get(feed)), told


def _begun(plant: Plant, tank: Tank, seed: int) -> Tank:
    level = float(stream(seed, f"start {tank.name}").uniform(*STARTS))
    most = [HIGHEST / s.gain for s in plant.sensors if s.tank == tank.name]
    return replace(tank, level=min([level, *most]))
