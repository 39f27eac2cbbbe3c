"""Every effect of kb/: each parameter moves something, told with its source, joined where meant.

That an effect is off at its null, with starts in the range and known slots, is what a check of the
knowledge base says.
"""

import contextlib
import functools
import random
import re
from collections.abc import Mapping

import pytest

from rulec.effects.model_builder import open_builder
from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.effect import PLAIN, Effect, EffectParameter, Join
from rulec.knowledge.effect_trials import parameters, plain_laws, readings
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.read import read_files
from rulec.language.expression import Rejected, constant
from rulec.language.units import NONE, Unit
from tests.conftest import ROOT, plain_yaml


@functools.cache
def knowledge() -> Knowledge:
    """The shipped knowledge base."""
    (sources,), _, found = read_files([ROOT / "kb"])
    assert found == []
    return check_knowledge(sources)


SHIPPED = [plain_yaml(file)["effect"] for file in sorted((ROOT / "kb" / "effects").rglob("*.yaml"))]
"""Names of all effects. What they mean is read when a test runs: to collect tests takes no
knowledge base."""
MATCHES = plain_yaml(ROOT / "tests/kb/matches.yaml")


def values(effect: Effect, join: Join, given: Mapping[str, float], seed: int) -> list[float]:
    """What the laws of a join and its states give, over the same plain law for a seed."""
    given = {**plain_laws(join, given, random.Random(seed)), **given}
    parts = [law.expression for law in join.laws]
    parts += [e for state in effect.states.values() for _, e in state.equations()]
    return [constant(part, given) or 0.0 for part in parts]


@pytest.mark.parametrize("name", SHIPPED)
def test_every_parameter_moves_something(name: str) -> None:
    """Away from its null, in each join, where readings are about those at which it acts."""
    effect, draw = knowledge().effects[name], random.Random(1)
    for join in effect.joins:
        still = {n: p for n, p in effect.parameters.items() if not p.fixed}
        for seed in range(200):
            given = readings(effect, draw)
            given |= parameters(effect, given, draw)
            law = plain_laws(join, given, random.Random(seed))["law"]
            of_law = [n for n, p in effect.parameters.items() if p.driver == "law"]
            given |= {n: law * draw.uniform(0.5, 2.0) for n in of_law}
            # What is stored is off its rest by a fifth, and moves at its rate.
            given |= dict.fromkeys(effect.states, 0.8 * law)
            for n, p in [*still.items()]:
                other = 1.2 * given[n] if p.null is None or effect.states else p.null
                with contextlib.suppress(Rejected):
                    both = (values(effect, join, k, seed) for k in (given, {**given, n: other}))
                    if any(abs(a - b) > 1e-6 * abs(a + b) for a, b in zip(*both, strict=True)):
                        del still[n]
        assert still == {}, join


@pytest.mark.parametrize("name", SHIPPED)
def test_entry_is_sound(name: str) -> None:
    """No start is the null. The sentence names the module and how strong the effect is. The source
    is a citation with a year or a number, a law by its name, or an honest [assumed]."""
    effect = knowledge().effects[name]
    assert all(p.null not in p.starts for p in effect.parameters.values() if not p.fixed)
    strength = {n for n, p in effect.parameters.items() if p.null is not None}
    slots = set(re.findall(r"\{(\w+)(?::%)?\}", effect.text))
    assert "module" in slots
    assert slots & strength
    named = r"\d|assumed|own derivation|law|branch|hydrostatics|characteristic|balance|Weisbach"
    assert re.search(rf"{named}|Handbook|Poiseuille", effect.origin.source)


@pytest.mark.parametrize(
    ("name", "parameter", "neutral"),
    [
        ("head-speed", "n0", True),
        ("head-temperature", "T0", True),
        ("pump-upturn", "u0", False),
        ("tank-leak", "l0", False),
    ],
)
def test_reading_at_which_an_effect_vanishes(name: str, parameter: str, neutral: bool) -> None:
    """Also where the law changes a reading, and where another parameter switches the effect off."""
    assert knowledge().effects[name].parameters[parameter].neutral is neutral


def test_each_effect_has_a_place() -> None:
    """But for one of a tank whose plant has no balance, which no shipped plant has."""
    named = {
        name
        for modules in MATCHES.values()
        for places in modules.values()
        for names in places.values()
        for name in names
    }
    assert set(SHIPPED) - named == {"tank-overflow"}


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


def test_a_null_is_in_the_unit_of_the_signal_that_is_joined() -> None:
    """As the range of the parameter is."""
    unit, bar = Unit(PLAIN, 1.0, NONE), knowledge().units.parse("bar")
    own = {"null": 2.0, "lowest": 0.0, "highest": 5.0, "of_place": True}
    there = EffectParameter(name="a", title="", unit=unit, **own).at(bar, bar)
    assert (there.null, there.lowest, there.highest) == (2e5, 0.0, 5e5)
