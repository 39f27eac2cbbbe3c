"""The key: right names, places and parameters of a planted effect, from `key.yaml`."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from .build import Setup
from .size import Planted

FILE = Path(__file__).with_name("key.yaml")

FEED = {True: {"set": "Q", "flow": "flow"}, False: {"set": "u", "flow": "pump"}}
"""Places of a feed in its module type, metered or not."""


@dataclass(frozen=True)
class Right:
    """The right answer for an effect; see `sealed.Planted`."""

    names: tuple[str, ...]
    places: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, float]]


def right(setup: Setup, one: Planted) -> Right:
    """Look up the right answer for a planted effect."""
    entry = _key()[id_of(one)]
    met = _conditions(setup, one)
    holding = [r for r in entry.get("right", ()) if met.issuperset(r.get("if", ()))]
    values = _values(setup, one)
    places = [*entry["places"], *(p for r in holding for p in r.get("places", ()))]
    found = [_placed(setup, one.placed.place, p) for p in places]
    named = {r["name"]: r.get("parameters", {}) for r in holding if "name" in r}
    return Right(
        tuple(named),
        tuple(dict.fromkeys(place for some in found for place in some)),
        {
            name: {p: _sum(terms, values) for p, terms in stated.items()}
            for name, stated in named.items()
            if stated
        },
    )


def id_of(one: Planted) -> str:
    """Return the id in the key: `y.lag` of a sensor, `lag` of the feed."""
    effect = one.placed.effect
    return f"y.{effect.name}" if effect.at == "sensor" else effect.name


@functools.cache
def _key() -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return loaded


def _conditions(setup: Setup, one: Planted) -> set[str]:
    """The words of `if` that hold for the plant and the place."""
    layout, place = setup.layout, one.placed.place
    values = {name: value for name, (value, _) in one.built.values.items()}
    feed = setup.plant.feed
    holds = {
        "first": place == layout.tanks[0],
        "last": place == layout.tanks[-1],
        "voltage": not layout.metered,
        "one sensor": len(layout.measured) == 1,
        "caught": values.get("caught", 0.0) > 0.0,
        "lost": values.get("caught", 0.0) == 0.0,
        # The input never falls into the dead band, or below the flow that is lost.
        "always": setup.shown.min() + feed.zero
        > values.get("dead band", values.get("flow", math.inf) / feed.gain),
    }
    return {word for word, true in holds.items() if true}


def _values(setup: Setup, one: Planted) -> dict[str, float]:
    """True values for the terms of parameters: of effect, tank, sensor and feed."""
    plant, place = setup.plant, one.placed.place
    known = {"k": plant.feed.gain, "zero": plant.feed.zero}
    for sensor in plant.sensors:
        if sensor.tank == place:
            known["gain"] = sensor.gain
    for tank in plant.tanks:
        if tank.name == place:
            known |= {"floor": tank.area, "outlet": tank.outlet}
    return known | {name: value for name, (value, _) in one.built.values.items()}


def _sum(terms: Sequence[Sequence[float | str]], values: Mapping[str, float]) -> float:
    """A sum of products; `/name` divides."""

    def value(factor: float | str) -> float:
        if not isinstance(factor, str):
            return float(factor)
        return 1.0 / values[factor[1:]] if factor.startswith("/") else values[factor]

    return sum(math.prod(map(value, factors)) for factors in terms)


def _placed(setup: Setup, here: str, place: str) -> Iterator[str]:
    """Places such as `upper.inflow` for `here.inflow`; `each` means all tanks."""
    layout = setup.layout
    where, _, what = place.partition(".")
    match where:
        case "feed":
            yield f"{layout.feed}.{FEED[layout.metered][what]}"
        case "each":
            yield from (f"{tank}.{what}" for tank in layout.tanks)
        case _:
            tanks = {
                "here": here,
                "first": layout.tanks[0],
                "second": layout.tanks[1],
                "last": layout.tanks[-1],
            }
            yield f"{tanks[where]}.{what}"
