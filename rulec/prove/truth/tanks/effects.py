"""All effects, from `effects.yaml`, by the ids of a case: `upper.leak`, `lower.y.lag`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from ..formulas import Names
from .build import Layout
from .effect import Effect

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


def facts(layout: Layout, place: str) -> dict[str, Any]:
    """Return what formulas may ask of a place in a plant.

    The datum of a level that is not `measured` is arbitrary; a flow meter already measures what a
    pump does with its `voltage`.
    """
    return {
        "first": place == layout.tanks[0],
        "last": place == layout.tanks[-1],
        "measured": place in layout.measured,
        "one_sensor": len(layout.measured) == 1,
        "voltage": not layout.metered,
    }


def possible_effects(layout: Layout) -> dict[str, Placed]:
    """Return every effect at every place of a plant where it can show, by id."""
    places = {"tank": layout.tanks, "feed": (layout.feed,), "sensor": layout.measured}
    every = [Placed(effect, place) for effect in EFFECTS for place in places[effect.at]]
    return {p.id: p for p in every if _shows(layout, p)}


def _shows(layout: Layout, placed: Placed) -> bool:
    where = placed.effect.stated.get("where", "1")
    return bool(Names(None, facts(layout, placed.place)).of(where))


def _effect(key: str, stated: Mapping[str, Any]) -> Effect:
    """A key such as `y.lag` is of a sensor."""
    name, (low, high) = key.removeprefix("y."), map(float, stated["size"])
    at = "sensor" if name != key else stated.get("at", "tank")
    sort = stated.get("sort", "sensor" if at == "sensor" else "physics")
    return Effect(name, stated["title"], sort, at, low, high, stated.get("scale", 1.0), stated)


FILE = Path(__file__).with_name("effects.yaml")
EFFECTS = tuple(
    _effect(key, stated) for key, stated in yaml.safe_load(FILE.read_text(encoding="utf-8")).items()
)
