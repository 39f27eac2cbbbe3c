"""Every effect of kb/: off at its null, something when on, joined to the places it is meant for."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
import sympy

from rulec.effects.model_builder import open_builder
from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.effect import Driver, Effect, EffectParameter, Join
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.read import read_files
from rulec.language.expression import Expression
from rulec.language.symbolic import to_sympy
from rulec.language.units import NONE, Unit
from tests.conftest import ROOT, plain_yaml

ORDINARY = {
    "pressure difference": (0.5e5, 10e5),
    "suction pressure": (-0.9e5, 1e5),
    "ambient pressure": (0.9e5, 1.05e5),
    "rotational speed": (5.0, 50.0),
    "frequency": (30.0, 60.0),
    "volume flow": (1e-5, 1e-3),
    "mass flow": (0.01, 10.0),
    "displaced volume": (1e-6, 1e-3),
    "pulse frequency": (10.0, 1000.0),
    "temperature": (283.0, 333.0),
    "level": (0.2, 3.0),
    "head": (1.0, 40.0),
    "viscosity": (1e-3, 1.0),
    "density": (700.0, 1300.0),
    "electric power": (20.0, 5000.0),
    "torque": (1.0, 100.0),
    "angle": (0.1, 1.0),
    "valve travel": (0.1, 1.0),
    "reading": (0.5, 9.0),
    "time": (1.0, 1e5),
}
"""Readings of an ordinary plant, SI."""

POINTS = 40
Array = Any
Laws = dict[str, Array]


@functools.cache
def knowledge() -> Knowledge:
    """The shipped knowledge base."""
    (sources,), _, found = read_files([ROOT / "kb"])
    assert found == []
    return check_knowledge(sources)


SHIPPED = {
    data["effect"]: len(data["joins"])
    for data in map(plain_yaml, sorted((ROOT / "kb" / "effects").rglob("*.yaml")))
}
"""Names of all effects, each with its number of joins. What they mean is read when a test runs: to
collect tests takes no knowledge base."""
JOINS = [(name, i) for name, count in SHIPPED.items() for i in range(count)]
MATCHES = plain_yaml(ROOT / "tests/kb/matches.yaml")
TABLE = plain_yaml(ROOT / "tests/kb/effects.yaml")


def drawn(effect: Effect, draw: np.random.Generator) -> dict[str, Array]:
    """Readings of all drivers, and the medians that fixed parameters stand for."""
    known = {n: reading(d, draw) for n, d in effect.drivers.items()}
    return {**known, **usual(effect, known)}


def usual(effect: Effect, known: Mapping[str, Array]) -> dict[str, float]:
    """Fixed parameters at readings that are known, medians or half the distance of two."""
    found = {}
    for n, p in effect.parameters.items():
        if p.fixed and p.driver in known:
            readings = known[p.driver]
            two = len(p.quantiles) == 2
            ends = np.quantile(readings, p.quantiles if two else (0.5, 0.5))
            found[n] = 0.5 * float(np.diff(ends)[0]) if two else float(ends[0])
    return found


def reading(driver: Driver, draw: np.random.Generator) -> Array:
    """Readings of any size in the ordinary range; a gauge pressure may be below none."""
    # A pressure that no equation reads stands before or behind something, and not across it.
    low, high = ORDINARY["suction pressure" if driver.where == "unread" else driver.quantity]
    if low < 0.0:
        return draw.uniform(low, high, POINTS)
    return np.exp(draw.uniform(*np.log((low, high)), POINTS))


def function(expression: Expression) -> Callable[[Mapping[str, Array]], Array]:
    """An expression as a numpy function of its names."""
    names = sorted({name for name, _ in expression.names()})
    symbols = {name: sympy.Symbol(name, real=True) for name in names}
    compiled = sympy.lambdify(list(symbols.values()), to_sympy(expression, symbols), MODULES)
    return lambda known: compiled(*(known[name] for name in names))


MODULES = [{"Larger": np.maximum, "Smaller": np.minimum, "Absolute": np.abs}, "numpy"]


def quantity_of(join: Join) -> str:
    """An ordinary quantity that a join's place may have."""
    asked = join.gives or join.reads or join.stores or join.shows
    return "volume flow" if join.flows else "level" if asked == "any" else asked


def stored(effect: Effect, laws: Laws) -> dict[str, Array]:
    """What an effect stores, settled: it follows the plain law."""
    return dict.fromkeys(effect.states, laws["law"])


def plain_laws(join: Join, known: Mapping[str, Array], draw: np.random.Generator) -> Laws:
    """A plain law, linear in the drivers that the join replaces, and it with them replaced."""
    low, high = ORDINARY[quantity_of(join)]
    size = np.exp(draw.uniform(np.log(low), np.log(high)))
    replaced = sorted({name for part in join.law.substitutes.values() for name in part})
    bend = {n: draw.uniform(-0.3, 0.3) / float(np.max(known[n])) for n in replaced}

    def law(at: Mapping[str, Array]) -> Array:
        return size * (1.0 + sum(slope * at[name] for name, slope in bend.items()))

    laws = {"law": law(known)}
    for key, part in join.law.substitutes.items():
        laws[key] = law({**known, **{name: function(e)(known) for name, e in part.items()}})
    return laws


def at_start(p: EffectParameter, known: Mapping[str, Array]) -> float:
    """First start of a parameter, or the first quantile of its driver."""
    return p.starts[0] if p.starts else float(np.quantile(known[p.driver or ""], p.quantiles[0]))


@pytest.mark.parametrize(("name", "i"), JOINS)
def test_null_gives_the_plain_law_back(name: str, i: int) -> None:
    """At the null of all parameters, wherever the shaping ones are, nothing has changed: 1e-12."""
    effect, draw = knowledge().effects[name], np.random.default_rng(i)
    join = effect.joins[i]
    for _ in range(5):
        known = drawn(effect, draw)
        free = {n: p for n, p in effect.parameters.items() if not p.fixed}
        known |= {
            n: float(draw.uniform(p.lowest, p.highest)) if p.null is None else p.null
            for n, p in free.items()
        }
        known |= plain_laws(join, known, draw)
        known |= usual(effect, {"law": known["law"] * np.linspace(0.5, 1.0, POINTS)})
        known |= stored(effect, known)
        for law in join.laws:
            assert function(law.expression)(known) == pytest.approx(known["law"], rel=1e-12)


@pytest.mark.parametrize(("name", "i"), JOINS)
def test_every_parameter_moves_something(name: str, i: int) -> None:
    """Off its null the law is another, a finite number, and each parameter moves it."""
    effect, draw = knowledge().effects[name], np.random.default_rng(i)
    join, readings = effect.joins[i], drawn(effect, draw)
    unit = Unit("1", ORDINARY[quantity_of(join)][0], NONE)
    free = {n: p.at(unit, unit) for n, p in effect.parameters.items() if not p.fixed}
    starts = {n: at_start(p, readings) for n, p in free.items() if p.driver != "law"}
    shown = plain_laws(join, {**readings, **starts}, np.random.default_rng(i))["law"]
    varying = {"law": shown * np.linspace(0.5, 1.0, POINTS)}
    starts |= {n: at_start(p, varying) for n, p in free.items() if p.driver == "law"}
    readings |= usual(effect, varying)

    def value(changed: Mapping[str, float]) -> Array:
        known = {**readings, **starts, **changed}
        known |= plain_laws(join, known, np.random.default_rng(i))
        if any(p.driver == "law" for p in effect.parameters.values()):
            known["law"] = varying["law"]
        # Off its rest by a fifth, what is stored moves at its rate, within its limits.
        known |= dict.fromkeys(effect.states, 0.8 * known["law"])
        parts = [law.expression for law in join.laws]
        parts += [e for state in effect.states.values() for _, e in state.equations()]
        rows = [np.broadcast_to(function(e)(known), POINTS) for e in parts]
        return np.concatenate(rows)

    assert np.all(np.isfinite(value({})))
    for n, p in free.items():
        # With no lag at all, what is stored would follow at an infinite rate.
        other = 1.2 * starts[n] if p.null is None or effect.states else p.null
        here, there = value({}), value({n: other})
        change = np.nanmax(np.abs(here - there) / (np.abs(here) + np.abs(there) + 1e-300))
        assert change > 1e-6, n


@pytest.mark.parametrize("name", SHIPPED)
def test_entry_is_sound(name: str) -> None:
    """Null and starts lie in the range; one parameter at least has a null, and no start is it. The
    sentence names the module and how strong the effect is, and can be filled. The source is a
    citation with a year or a number, a law by its name, or an honest [assumed]."""
    effect = knowledge().effects[name]
    free = [p for p in effect.parameters.values() if not p.fixed]
    for p in free:
        inside = [p.null or p.lowest, *p.starts]
        assert all(p.lowest <= value <= p.highest for value in inside), p.name
        assert p.null not in p.starts
        assert bool(p.starts) != bool(p.quantiles)
    strength = {n for n, p in effect.parameters.items() if p.null is not None}
    slots = set(re.findall(r"\{(\w+)(?::%)?\}", effect.text))
    known = set.intersection(*(effect.needed_by(join) for join in effect.joins))
    assert "module" in slots
    assert slots & strength
    assert slots <= {*known, "module", "place"}
    named = r"\d|assumed|own derivation|law|branch|hydrostatics|characteristic|balance|Weisbach"
    assert re.search(rf"{named}|Handbook|Poiseuille", effect.origin.source)


def joins(effect: Effect, place: Mapping[str, Any]) -> bool:
    """Whether any join of an effect fits a kind of place; one with states only where states are."""
    if effect.states and not place.get("stores_it"):
        return False

    def slope(join: Join, key: str) -> bool:
        driver = getattr(join, key)
        if driver and effect.drivers[driver].where == "read" and place.get("stores_it"):
            return False
        return not driver or effect.drivers[driver].quantity in place.get(key, ())

    def beside(join: Join) -> bool:
        used = (effect.drivers[n] for n in effect.needed_by(join) if n in effect.drivers)
        asked = {d.quantity for d in used if d.where == "beside"}
        return asked <= set(place.get("beside", ()))

    for join in effect.joins:
        sort = next(key for key in ("reads", "stores", "shows", "flows", "gives") if key in place)
        if sort != "gives":
            asked = getattr(join, sort)
            if asked == place[sort] or (asked == "any" and sort in ("reads", "shows")):
                return True
        elif (
            join.gives == place["gives"]
            and join.measured == place.get("measured", False)
            and join.steep in (None, place.get("steep"))
            and slope(join, "falls_with")
            and slope(join, "rises_with")
            and beside(join)
        ):
            return True
    return False


@pytest.mark.parametrize("kind", TABLE)
def test_effects_join_the_places_they_are_meant_for(kind: str) -> None:
    """For each kind of place all effects that join it, and no others; each effect has a place."""
    found = {
        name for name, effect in knowledge().effects.items() if joins(effect, TABLE[kind]["place"])
    }
    assert set(TABLE[kind]["effects"]) == found
    assert {name for part in TABLE.values() for name in part["effects"]} == set(SHIPPED)


@pytest.mark.parametrize("plant", MATCHES)
def test_effects_join_real_plants_as_listed(plant: str) -> None:
    """Module by module and place by place: these effects join, and no others."""
    candidates = open_builder(ROOT / plant)[1].candidates
    ids = [c.id for c in candidates] + [u.id for c in candidates for u in c.unknowns]
    assert len(ids) == len(set(ids))
    found: dict[str, dict[str, set[str]]] = {module: {} for module in MATCHES[plant]}
    for c in candidates:
        if c.module in found and "@" in c.id:
            found[c.module].setdefault(c.place, set()).add(c.name)
    expected = {
        module: {place: set(names) for place, names in places.items()}
        for module, places in MATCHES[plant].items()
    }
    assert expected == found
