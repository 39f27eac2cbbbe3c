"""Effects of tanks, from `effects.yaml`: their place and size, how they are built into a plant, and
what a perfect analysis calls them.

Ids of a case are such as `upper.leak` and `lower.y.lag`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..formulas import Drawn, Names
from ..units import Array
from .build import Setup
from .plant import CONSTANTS, SENSOR, Layout, Plant


@dataclass(frozen=True)
class Built:
    """A plant with one more effect; `names` has the effect's numbers, its size among them."""

    plant: Plant
    names: Names


@dataclass(frozen=True)
class Effect:
    """A kind of effect; see `effects.yaml`.

    Attributes
    ----------
    at : the part it belongs to: `tank`, `feed` or `sensor`
    low, high : of the size; the change by an effect rises with its size
    scale : of the target change, for effects that would otherwise be unrealistic
    """

    name: str
    title: str
    sort: str
    at: str
    low: float
    high: float
    scale: float
    stated: Mapping[str, Any] = field(repr=False, compare=False)


@dataclass(frozen=True)
class Placed:
    """An effect and its place: a tank, the feed, or a sensor by its tank."""

    effect: Effect
    place: str

    @property
    def part(self) -> str:
        """The place in a plant file: a module, or a signal."""
        return f"{self.place}{SENSOR}" if self.effect.at == "sensor" else self.place

    @property
    def id(self) -> str:
        """Such as `lower.y.clipping`."""
        return f"{self.part}.{self.effect.name}"


@dataclass(frozen=True)
class Here(Drawn):
    """Place and size of an effect.

    `plant` has the effects that were built before, `place` is a tank (of a sensor: its tank) or the
    feed. All attributes are names in the formulas.
    """

    setup: Setup
    plant: Plant
    place: str

    def quantile(self, values: Array, share: float) -> float:
        """Return a quantile."""
        return float(np.quantile(values, share))

    def time_at(self, share: float) -> float:
        """Return the time after a share of the recording, s."""
        time = self.setup.course.time
        return round(float(time[0] + share * np.ptp(time)), 1)

    def level(self, share: float) -> float:
        """Return a quantile of the level here, cm."""
        return self.quantile(self.setup.levels(self.place), share)

    def voltage_at(self, share: float) -> float:
        """Return a quantile of the reading here, V."""
        gain = self.plant.sensors[self.place]["gain"]
        return round(self.quantile(gain * self.setup.levels(self.place), share), 2)


def made(placed: Placed, here: Here) -> Built:
    """Build an effect into the plant."""
    stated, names = placed.effect.stated, Names(here, CONSTANTS, NAMES, size=here.size)
    names.fix(stated.get("fixed", {}))
    numbers = {field: float(names.of(formula)) for field, formula in stated.get("set", {}).items()}
    added = {field: float(names.of(formula)) for field, formula in stated.get("each", {}).items()}
    plant = here.plant.with_(placed.part, **numbers)
    for name, tank in plant.tanks.items() if added else ():
        plant = plant.with_(name, **{field: tank[field] + more for field, more in added.items()})
    names.update(numbers | added)
    return Built(plant, names)


def possible_effects(layout: Layout) -> dict[str, Placed]:
    """Return every effect at every place of a plant where it can show, by id."""
    places = {"tank": layout.tanks, "feed": (layout.feed,), "sensor": layout.measured}
    every = [Placed(effect, place) for effect in EFFECTS for place in places[effect.at]]

    def shows(placed: Placed) -> bool:
        names = Names(None, {"layout": layout, "place": placed.place}, NAMES)
        return bool(names.of(placed.effect.stated.get("where", "1")))

    return {placed.id: placed for placed in every if shows(placed)}


def right(placed: Placed, built: Built) -> dict[str, Any]:
    """Return the right `names`, `places` and `parameters` of an effect; see `sealed.Planted`."""
    layout, stated, names = built.plant.layout, placed.effect.stated, built.names
    holding = [r for r in stated.get("right", ()) if names.of(r.get("if", "1"))]
    places = [*stated["places"], *(p for r in holding for p in r.get("places", ()))]
    named = {r["name"]: r.get("parameters", {}) for r in holding if "name" in r}
    return {
        "names": tuple(named),
        "places": tuple(dict.fromkeys(x for p in places for x in _places(layout, placed.place, p))),
        "parameters": {
            name: {p: float(names.of(formula)) for p, formula in formulas.items()}
            for name, formulas in named.items()
            if formulas
        },
    }


def _places(layout: Layout, here: str, place: str) -> Iterator[str]:
    """Places such as `upper.inflow` for `here.inflow`; `each` means all tanks."""
    where, _, what = place.partition(".")
    if where == "feed":
        of_meter = {"set": "Q", "flow": "flow"}
        of_pump = {"set": "u", "flow": "pump"}
        yield f"{layout.feed}.{(of_meter if layout.metered else of_pump)[what]}"
    elif where == "each":
        yield from (f"{tank}.{what}" for tank in layout.tanks)
    else:
        first, second, *_ = layout.tanks
        tanks = {"here": here, "first": first, "second": second, "last": layout.tanks[-1]}
        yield f"{tanks[where]}.{what}"


def _effect(key: str, stated: Mapping[str, Any]) -> Effect:
    """A key such as `y.lag` is of a sensor."""
    name, (low, high) = key.removeprefix("y."), map(float, stated["size"])
    at = "sensor" if name != key else stated.get("at", "tank")
    sort = stated.get("sort", "sensor" if at == "sensor" else "physics")
    return Effect(name, stated["title"], sort, at, low, high, stated.get("scale", 1.0), stated)


_TABLE = yaml.safe_load(Path(__file__).with_name("effects.yaml").read_text(encoding="utf-8"))
NAMES: Mapping[str, str] = _TABLE.pop("names")
"""What formulas may ask of a place, beside the attributes of `Here`."""

EFFECTS = tuple(_effect(key, stated) for key, stated in _TABLE.items())
