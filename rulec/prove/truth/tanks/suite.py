"""The dynamic cases of the proof: a list by seed; each is made when it is needed.

Plants are the shipped one, and rows of tanks with a random number, names, feed and sensors.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from ..formulas import Names
from ..kinds import STATED, counts, difficulties, masked_pairs
from ..streams import stream
from .effect import possible_effects
from .plan import Planned
from .plant import CASCADED, Layout
from .rows import row

WEAKEST, STRONGEST = 0.03, 2.0
"""V; change by a single effect, drawn uniformly on a logarithmic scale."""

HARD = counts("tanks", "hard")
FEW = "few-values"
"""Profile of a plant with form errors, which shows its laws at a few flows only."""

RARELY = 0.15
"""Largest share of samples in which an effect in a corner acts."""

OWN_PLANT = 0.5
"""Share of cases of the shipped plant; the others have random rows."""

SETTLED = 0.2
"""Share of cases with long constant inputs."""

UNSEEN = ("gain-high", "gain-low")
"""Effects that a recalibration compensates, so that nothing is missing."""


def cases(
    seed: int, count: Mapping[str, int], samples: int = 1024, own: float = OWN_PLANT
) -> Iterator[Planned]:
    """Yield `count` cases by group; a case depends on seed, group and number only.

    `own` is the share of cases of the shipped plant.
    """
    for group, many in count.items():
        for number in range(many):
            random = stream(seed, f"dynamic {group} {number}")
            plant_seed = int(random.integers(2**31))
            shipped = group == "hiding" or random.uniform() < own
            layout = CASCADED if shipped else row(plant_seed)
            strength, hard = None, difficulties("tanks", group)
            if group not in ("clean", "pair", "hiding") and not group.endswith("-clean"):
                strength = WEAKEST * (STRONGEST / WEAKEST) ** float(random.uniform())
            # A plateau is no corner.
            settled = random.uniform() < SETTLED and group != "corner"
            effects = _chosen(group, number, layout, random)
            yield Planned(
                "-".join(["dynamic", group, str(number), *effects]),
                group,
                plant_seed,
                layout,
                effects,
                samples,
                strength,
                profile=FEW if "form" in hard else "plateaus" if settled else "",
                rarely=RARELY if group == "corner" else math.inf,
                difficulties=hard,
            )


def _chosen(
    group: str, number: int, layout: Layout, random: np.random.Generator
) -> tuple[str, ...]:
    if group == "clean" or group.endswith("-clean"):
        return ()
    if group == "hiding":
        pairs = masked_pairs("tanks")
        return pairs[number % len(pairs)]
    formula = STATED["tanks"][group]["of"]
    possible = possible_effects(layout).values()
    fitting = [
        p for p in possible if Names(p.effect, {"plain": p.effect.name not in UNSEEN}).of(formula)
    ]
    # Kinds first, then places, so that many tanks do not make one kind more frequent.
    kinds = sorted({(p.effect.name, p.effect.at) for p in fitting})
    order = random.permutation(len(kinds))[: 2 if group == "pair" else 1]
    found = []
    for i in order.tolist():
        places = [p.id for p in fitting if (p.effect.name, p.effect.at) == kinds[i]]
        found.append(places[int(random.integers(len(places)))])
    return tuple(found)
