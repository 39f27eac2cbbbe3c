"""The dynamic cases of the proof: a list by seed; each is made when it is needed.

Plants are the shipped one, and rows of tanks with a random number, names, feed and sensors.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..formulas import Names
from ..kinds import STATED, counts, difficulties, hiding
from ..streams import stream
from .build import CASCADED, Layout
from .case import Case, case
from .effect import possible_effects
from .sealed import SealedCase

WEAKEST, STRONGEST = 0.03, 2.0
"""V; change by a single effect, drawn uniformly on a logarithmic scale."""

HARD = counts("tanks", "hard")
CONCEALED: Mapping[str, str] = {
    group: stated["concealed"] for group, stated in STATED["tanks"].items() if group not in HARD
}
"""Way of concealing by group."""

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

LEAST = 4.0
"""Least expected gain of a single effect."""

NAMES = (
    ("upper", "centre", "lower", "bottom"),
    ("north", "east", "south", "west"),
    ("T1", "T2", "T3", "T4"),
    ("settling", "buffer", "storage", "sump"),
)
FEEDS, MAINS = ("pump", "supply", "P1"), ("mains", "inflow", "F1")

FEWEST, MOST = 2, 4
"""Tanks in a row."""

ALSO_MEASURED = 0.4
"""Probability that a tank above the last one is also measured."""

METERED = 0.4
"""Probability that a flow meter shows the feed, instead of the voltage of a pump."""

INTERVALS = (3.0, 4.0, 5.0)
"""s"""


@dataclass(frozen=True)
class Planned:
    """A case to be made; `strength` is in V, or None for a drawn one; `rarely` as in `case`."""

    group: str
    number: int
    seed: int
    layout: Layout
    effects: tuple[str, ...]
    samples: int = 1024
    strength: float | None = None
    profile: str = ""
    rarely: float = math.inf
    difficulties: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Unique name, which is in no file that the analysis gets."""
        return "-".join(["dynamic", self.group, str(self.number), *self.effects])

    def make(self) -> SealedCase:
        """Simulate it. Raises ValueError if no drawn plant shows it."""
        made = case(
            self.seed,
            self.effects,
            self.samples,
            self.layout,
            name=self.name,
            hiding=self.group == "hiding",
            strength=self.strength,
            profile=self.profile,
            rarely=self.rarely,
            difficulties=self.difficulties,
        )
        found = SealedCase(made, (self._concealed(made),))
        if len(found.answer.effects) == 1 and found.answer.effects[0].gain < LEAST:
            raise ValueError("nobody could see it")
        return found

    def _concealed(self, made: Case) -> str:
        """Way of concealment; of a hard case, by its planted effects."""
        if self.group in CONCEALED:
            return CONCEALED[self.group]
        sorts = [one.placed.effect.sort for one in made.planted]
        return "clean" if not sorts else "unnamed" if "unnamed" in sorts else "open"


def cases(
    seed: int, count: Mapping[str, int], samples: int = 1024, own: float = OWN_PLANT
) -> Iterator[Planned]:
    """Yield `count` cases by group; a case depends on seed, group and number only.

    `own` is the share of cases of the shipped plant.
    """
    for group, many in count.items():
        if group not in {**CONCEALED, **HARD}:
            raise ValueError(f"no group '{group}'; known: {', '.join({**CONCEALED, **HARD})}")
        for number in range(many):
            yield _planned(seed, group, number, samples, own)


def row(seed: int) -> Layout:
    """Draw a row of tanks; the last one is measured, as nothing else depends on it."""
    random = stream(seed, "row")
    count = int(random.integers(FEWEST, MOST + 1))
    tanks = NAMES[int(random.integers(len(NAMES)))][:count]
    also = random.uniform(size=count - 1) < ALSO_MEASURED
    measured = (*itertools.compress(tanks, also), tanks[-1])
    metered = bool(random.uniform() < METERED)
    feed = (MAINS if metered else FEEDS)[int(random.integers(len(FEEDS)))]
    interval = float(random.choice(INTERVALS))
    columns = {tank: f"L{tanks.index(tank) + 1} [V]" for tank in measured}
    inlet = "F [l/h]" if metered else "u [V]"
    return Layout(f"row-{seed}", feed, tanks, measured, metered, interval, inlet, columns)


def _planned(seed: int, group: str, number: int, samples: int, share: float) -> Planned:
    random = stream(seed, f"dynamic {group} {number}")
    own = int(random.integers(2**31))
    shipped = group == "hiding" or random.uniform() < share
    layout = CASCADED if shipped else row(own)
    strength = None
    hard = difficulties("tanks", group)
    if group not in ("clean", "pair", "hiding") and not group.endswith("-clean"):
        strength = WEAKEST * (STRONGEST / WEAKEST) ** float(random.uniform())
    settled = random.uniform() < SETTLED and group != "corner"  # a plateau is no corner
    profile = FEW if "form" in hard else "plateaus" if settled else ""
    effects = _chosen(group, number, layout, random)
    rarely = RARELY if group == "corner" else math.inf
    return Planned(group, number, own, layout, effects, samples, strength, profile, rarely, hard)


def _chosen(
    group: str, number: int, layout: Layout, random: np.random.Generator
) -> tuple[str, ...]:
    if group == "clean" or group.endswith("-clean"):
        return ()
    if group == "hiding":
        pairs = hiding("tanks")
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
