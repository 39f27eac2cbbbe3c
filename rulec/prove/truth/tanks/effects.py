"""All effects by the names in which a case is written: `upper.leak`, `pump.lag`, `lower.y.lag`."""

from __future__ import annotations

from collections.abc import Iterator
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
"""A flow meter shows what flows: these are effects of a pump."""

SENSOR = ".y"
"""Mark of a sensor behind the name of its tank."""


@dataclass(frozen=True)
class Placed:
    """An effect and the tank, feed or sensor (by its tank) that it belongs to."""

    effect: Effect
    place: str

    @property
    def module(self) -> str:
        """The place as a plant file names it: a module, or a signal."""
        return f"{self.place}{SENSOR}" if self.effect.at == "sensor" else self.place

    @property
    def id(self) -> str:
        """`lower.y.clipping`."""
        return f"{self.module}.{self.effect.name}"


def possible_effects(layout: Layout) -> dict[str, Placed]:
    """Every effect at every place of a plant where it can show, by id."""
    return {placed.id: placed for placed in _all(layout)}


def _all(layout: Layout) -> Iterator[Placed]:
    places = {"tank": layout.tanks, "feed": (layout.feed,), "sensor": layout.measured}
    for effect in EFFECTS:
        for place in places[effect.at]:
            if _shows(layout, effect, place):
                yield Placed(effect, place)


def _shows(layout: Layout, effect: Effect, place: str) -> bool:
    """An unmeasured level may be counted from anywhere; below the last tank is nothing."""
    match effect.name:
        case "outlet-height":
            return place in layout.measured
        case "evaporation":
            return place == layout.tanks[0]
        case "drowned" | "link":
            return place != layout.tanks[-1]
        case "drain":
            # A pump whose gain is free makes up for the share that a tank loses.
            return layout.metered and place != layout.tanks[-1]
        case _:
            return not (layout.metered and effect.name in VOLTAGE_ONLY)
