"""The stationary cases of the proof: a list by seed; each is made when it is needed."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ..formulas import Names
from ..kinds import STATED, counts, difficulties, masked_pairs
from ..smooth import between
from .drive import PRODUCTION
from .effect import EFFECTS, WIRING, Effect, effect_of
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
            aim = between(random, (WEAKEST, STRONGEST))
            if group in ("hiding", "pair", "unrecorded"):
                aim = max(aim, 100.0)
            profile = str(random.choice(PROFILES))
            wanted = [effect_of(e) for e in effects]
            oil = group != "unrecorded" and all(_on(e, "oil-set") for e in wanted)
            family = "oil" if oil and random.uniform() < 0.3 else "dosing"
            family = next((ALONE[e.kinds] for e in wanted if e.kinds in ALONE), family)
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
    pairs = _pairs(random)
    pools: Mapping[str, Sequence[tuple[str, ...]]] = {
        "hiding": masked_pairs("settled"),
        "wiring": [(name,) for name in WIRING],
        "pair": pairs,
    }
    formula = STATED["settled"][group].get("of", 0)
    named = ((e, Names(e, {"alone": e.kinds in ALONE})) for e in EFFECTS.values())
    fitting = [(e.name,) for e, names in named if names.of(formula)]
    pool = pools.get(group) or fitting or [()]
    order = list(random.permutation(len(pool)))
    return [pool[order[i % len(order)]] for i in range(count)]


def _pairs(random: np.random.Generator) -> list[tuple[str, ...]]:
    """Pairs of effects that one plant can have; the second may be a fault or a sensor error."""
    physics = [e.name for e in EFFECTS.values() if e.sort == "physics"]
    others = [e.name for e in EFFECTS.values() if e.sort in ("physics", "fault", "sensor")]
    found: list[tuple[str, ...]] = []
    while len(found) < 20:
        names = str(random.choice(physics)), str(random.choice(others))
        pair = [EFFECTS[name] for name in names]
        alone = {e.kinds[0] for e in pair if e.kinds in ALONE}
        meet = len(alone) < 2 and all(_on(e, kind) for e in pair for kind in alone)
        if names[0] != names[1] and meet:
            found.append(names)
    return found


def _on(effect: Effect, kind: str) -> bool:
    """Whether a kind of pump can have an effect."""
    return effect.at == "pump" and (not effect.kinds or kind in effect.kinds)
