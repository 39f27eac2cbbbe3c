"""All effects by the ids of a case: `upper.leak`, `pump.lag`, `lower.y.lag`."""

from __future__ import annotations

from dataclasses import dataclass

from .build import Layout
from .effect import Effect
from .feed_effects import BYPASS, FEED_EFFECTS
from .sensor_effects import JET, SENSOR_EFFECTS
from .tank_effects import TANK_EFFECTS, VORTEX

EFFECTS = (*TANK_EFFECTS, *FEED_EFFECTS, *SENSOR_EFFECTS, VORTEX, BYPASS, JET)

VOLTAGE_ONLY = (
    *("dead-band", "saturation", "droop", "play", "rate"),
    *("held", "lift", "lift-level", "roll-off", "upturn", "exponent", "decline", "warm-up"),
)
"""Effects of a pump, which a flow meter already measures."""

SENSOR = ".y"
"""Suffix of a sensor after the name of its tank."""


@dataclass(frozen=True)
class Placed:
    """An effect and its place: a tank, the feed, or a sensor by its tank."""

    effect: Effect
    place: str

    @property
    def module(self) -> str:
        """The place in a plant file: a module, or a signal."""
        return f"{self.place}{SENSOR}" if self.effect.at == "sensor" else self.place

    @property
    def id(self) -> str:
        """Such as `lower.y.clipping`."""
        return f"{self.module}.{self.effect.name}"


def possible_effects(layout: Layout) -> dict[str, Placed]:
    """Return every effect at every place of a plant where it can show, by id."""
    places = {"tank": layout.tanks, "feed": (layout.feed,), "sensor": layout.measured}
    every = [Placed(effect, place) for effect in EFFECTS for place in places[effect.at]]
    return {p.id: p for p in every if _shows(layout, p.effect, p.place)}


def _shows(layout: Layout, effect: Effect, place: str) -> bool:
    match effect.name:
        case "outlet-height":
            # The datum of a level that is not measured is arbitrary.
            return place in layout.measured
        case "evaporation":
            return place == layout.tanks[0]
        case "drowned" | "link":
            return place != layout.tanks[-1]
        case "drain":
            # The free gain of a pump compensates the share that a tank loses.
            return layout.metered and place != layout.tanks[-1]
        case _:
            return not (layout.metered and effect.name in VOLTAGE_ONLY)
