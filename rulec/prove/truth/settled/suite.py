"""The stationary cases of the proof: a list by seed; each is made when it is needed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .drive import PRODUCTION
from .effect import CONNECTIONS, EFFECTS, WIRING, Effect, effect_of
from .plan import Planned

WEAKEST, STRONGEST = 8.0, 2e4
"""Expected gain in log likelihood: from barely detectable to dominant."""

PROFILES = ("steps", "steps", "ramps", "start-stop", "long-constant")

FULL: Mapping[str, int] = {
    "clean": 100,
    "single": 54,
    "calibrated": 12,
    "correlated": 10,
    "sensor": 12,
    "fault": 18,
    "unnamed": 10,
    "unrecorded": 10,
    "pair": 12,
    "hiding": 8,
}
"""Cases of a run."""

QUICK: Mapping[str, int] = {"clean": 14, "single": 7, "sensor": 2, "fault": 2, "unnamed": 1}
"""Cases of a quick run, of small plants."""

HARD: Mapping[str, int] = {
    "form-clean": 50,
    "form": 50,
    "coloured-clean": 50,
    "coloured": 50,
    "drift-clean": 50,
    "drift": 50,
    "all-clean": 50,
    "all": 50,
    "wiring": 24,
}
"""Cases of a run with difficulties, all of them in the group `all`. Plants of the group `wiring`
obey their laws: the mistakes are in the cables or the file."""

PRODUCED: Mapping[str, int] = {"production": 36, "production-clean": 6, "production-unnamed": 6}
"""Cases of small plants that make a few products within a part of the allowed range; they obey
their laws."""

CONNECTED: Mapping[str, int] = {"connection": 24}
"""Cases of plants whose connections differ from the file; they obey their laws."""

HARD_QUICK: Mapping[str, int] = dict.fromkeys(HARD, 2)
"""Cases of a quick run with difficulties, of small plants."""

DIFFICULTIES: Mapping[str, tuple[str, ...]] = {
    "form": ("form",),
    "coloured": ("coloured", "wobble"),
    "drift": ("drift",),
    "all": ("form", "coloured", "wobble", "drift"),
}
"""By the first word of a group of `HARD`."""

ALONE = {("metered",): "bench", ("oil-warm",): "warm", ("valve",): "valve"}
"""Families of plants by the kinds of pumps, and valves, that are in no plant with others."""

HIDING = (
    ("wear", "fouling"),
    ("slip-warm", "fouling"),
    ("line-warm", "settling"),
    ("belt", "copper"),
    ("slip-warm", "settling"),
    ("belt", "windage"),
    ("line-warm", "dp-zero-warm"),
    ("warm-up-slip", "settling"),
    ("fouling", "dp-zero-creep"),
    ("friction-warm", "power-gain-creep"),
)
"""Two effects of one module with similar changes of the readings."""


def planned(seed: int, counts: Mapping[str, int] = FULL, small: bool = False) -> Iterator[Planned]:
    """Yield all cases of a run; the seed draws plants, operation, effects and strengths."""
    for group, count in counts.items():
        random = np.random.default_rng([seed, *group.encode()])
        for i, effects in enumerate(_drawn(group, count, random)):
            aim = math.exp(random.uniform(math.log(WEAKEST), math.log(STRONGEST)))
            if group in ("hiding", "pair", "unrecorded"):
                aim = max(aim, 100.0)
            profile = str(random.choice(PROFILES))
            kinds = [effect_of(e).kinds for e in effects]
            in_oil = all(
                e.at == "pump" and (not e.kinds or "oil-set" in e.kinds)
                for e in map(effect_of, effects)
            )
            oil = in_oil and group != "unrecorded"
            family = "oil" if oil and random.uniform() < 0.3 else "dosing"
            family = next((ALONE[k] for k in kinds if k in ALONE), family)
            conceal = (group,) if group in ("calibrated", "correlated") else ()
            if not effects and random.uniform() < 0.25:
                conceal = ("correlated",)
            difficulties = DIFFICULTIES.get(group.removesuffix("-clean"), ())
            if "form" in difficulties:
                profile = "few-states"
            if group in PRODUCED:
                profile = PRODUCTION
            name = f"stationary-{seed}-{group}-{'+'.join(effects)}-{i}"
            yield Planned(name, group, family, profile, effects, aim, conceal, small, difficulties)


def _drawn(group: str, count: int, random: np.random.Generator) -> list[tuple[str, ...]]:
    """Names of effects of each case: all in turn, in a drawn order."""
    pools: dict[str, Sequence[tuple[str, ...]]] = {
        "clean": [()],
        **{g: [()] for g in (*HARD, *PRODUCED) if g.endswith("-clean")},
        "hiding": HIDING,
        "wiring": [(name,) for name in WIRING],
        "connection": [(name,) for name in CONNECTIONS],
        "pair": _pairs(random),
    }
    pool = pools.get(group) or [(e.name,) for e in EFFECTS.values() if _fits(e, group)]
    order = list(random.permutation(len(pool)))
    return [pool[order[i % len(order)]] for i in range(count)]


def _pairs(random: np.random.Generator) -> list[tuple[str, ...]]:
    """Pairs of effects, of which the second may be a fault or a sensor error."""
    physics = [e.name for e in EFFECTS.values() if e.sort == "physics"]
    others = [e.name for e in EFFECTS.values() if e.sort in ("physics", "fault", "sensor")]
    found: list[tuple[str, ...]] = []
    while len(found) < 20:
        first, second = str(random.choice(physics)), str(random.choice(others))
        if first != second and _meet(EFFECTS[first], EFFECTS[second]):
            found.append((first, second))
    return found


def _meet(one: Effect, other: Effect) -> bool:
    """Whether one plant can have both."""
    alone = [e.kinds for e in (one, other) if e.kinds in ALONE]
    rest = [e for e in (one, other) if e.kinds not in ALONE]
    fit = all(e.at == "pump" and (not e.kinds or alone[0][0] in e.kinds) for e in rest if alone)
    return fit and len(set(alone)) < 2


def _fits(effect: Effect, group: str) -> bool:
    match group.removeprefix("production-"):
        case "single" | "production":
            return effect.sort == "physics"
        case "calibrated":
            # The effect must be on a pump that is calibrated during operation.
            fixed = effect.kinds == ("centrifugal",) or effect.kinds in ALONE
            return effect.sort == "physics" and not effect.timed and not fixed
        case "correlated":
            return effect.driver == "T"
        case "unrecorded":
            # By its readings, an effect that acts now and then is an intermittent fault.
            return effect.sort == "physics" and effect.driver != "" and not effect.corner
        case "form" | "coloured" | "drift" | "all":
            return True
        case sort:
            return effect.sort == sort
