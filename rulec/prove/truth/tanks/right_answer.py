"""The right names, places and parameters of a planted effect, from `effects.yaml`."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..formulas import Names
from .build import Setup
from .effect import facts
from .effect_size import Planted

FEED = {True: {"set": "Q", "flow": "flow"}, False: {"set": "u", "flow": "pump"}}
"""Places of a feed in its module type, metered or not."""


@dataclass(frozen=True)
class Right:
    """The right answer for an effect; see `sealed.Planted`."""

    names: tuple[str, ...]
    places: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, float]]


def right(setup: Setup, one: Planted) -> Right:
    """Return the right answer for a planted effect."""
    stated, plant, place = one.placed.effect.stated, setup.plant, one.placed.place
    known = {**facts(setup.layout, place), "k": plant.feed.gain, "zero": plant.feed.zero}
    known["lowest"] = setup.shown.min() + plant.feed.zero
    if place in setup.layout.measured:
        known["gain"] = plant.sensor(place).gain
    for tank in plant.tanks:
        if tank.name == place:
            known |= {"floor": tank.area, "outlet": tank.outlet}
    names = Names(None, known, **one.built.values)
    holding = [r for r in stated.get("right", ()) if names.of(r.get("if", "1"))]
    places = [*stated["places"], *(p for r in holding for p in r.get("places", ()))]
    found = [_placed(setup, place, p) for p in places]
    named = {r["name"]: r.get("parameters", {}) for r in holding if "name" in r}
    return Right(
        tuple(named),
        tuple(dict.fromkeys(place for some in found for place in some)),
        {
            name: {p: float(names.of(formula)) for p, formula in formulas.items()}
            for name, formulas in named.items()
            if formulas
        },
    )


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
