"""The stationary cases of the proof: a list by seed; each is made when it is needed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ..kinds import counts, difficulties, hiding
from .drive import PRODUCTION
from .effect import CONNECTIONS, EFFECTS, WIRING, Effect, effect_of
from .plan import Planned

WEAKEST, STRONGEST = 8.0, 2e4
"""Expected gain in log likelihood: from barely detectable to dominant."""

PROFILES = ("steps", "steps", "ramps", "start-stop", "long-constant")

FULL, HARD, PRODUCED = (counts("settled", run) for run in ("full", "hard", "produced"))

ALONE = {("metered",): "bench", ("oil-warm",): "warm", ("valve",): "valve"}
"""Families of plants by the kinds of pumps, and valves, that are in no plant with others."""


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
            harder = difficulties("settled", group)
            if "form" in harder:
                profile = "few-states"
            if group in PRODUCED:
                profile = PRODUCTION
            name = f"stationary-{seed}-{group}-{'+'.join(effects)}-{i}"
            yield Planned(name, group, family, profile, effects, aim, conceal, small, harder)


def _drawn(group: str, count: int, random: np.random.Generator) -> list[tuple[str, ...]]:
    """Names of effects of each case: all in turn, in a drawn order."""
    pools: dict[str, Sequence[tuple[str, ...]]] = {
        "clean": [()],
        **{g: [()] for g in (*HARD, *PRODUCED) if g.endswith("-clean")},
        "hiding": hiding("settled"),
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
