"""A planned case (its effects and their strength), how it is made, and its answer."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from .. import sealed
from ..recording import write_csv
from ..streams import FURTHER
from ..units import Array
from .build import Setup, build, recorded_input
from .detection_limit import gains
from .effect import Placed, possible_effects, right
from .effect_size import Planted, change_of, is_inside, make, most, plant_each, run
from .plant import Layout, Plant
from .rows import write_plant
from .sensing import shown

ATTEMPTS = 20
"""Most plants that are drawn until effects show as planned."""

CLEAR = 0.1
"""V; least change by all effects together, if their strength is drawn."""

LEAST = 4.0
"""Least expected gain of a single effect."""


@dataclass(frozen=True)
class Planned:
    """A case to be made; the same plan gives the same bytes.

    Attributes
    ----------
    name : unique, and in no file that the analysis gets
    group : of `cases.yaml`; effects of `hiding` must hide each other
    effects : their ids
    strength : RMS change by each effect alone, V; None if it is drawn
    rarely : largest size of an effect, for those whose size is the share of samples in which they
        act
    difficulties : of `cases.yaml`
    """

    name: str
    group: str
    seed: int
    layout: Layout
    effects: tuple[str, ...] = ()
    samples: int = 1024
    strength: float | None = None
    profile: str = ""
    rarely: float = math.inf
    difficulties: tuple[str, ...] = ()

    def make(self) -> Case:
        """Make a case that somebody could solve; raises ValueError if no plant shows the effects.

        A single effect that cannot be seen is not sought in another plant.
        """
        made = self.drawn()
        if len(made.planted) == 1 and made.answer.effects[0].gain < LEAST:
            raise ValueError("nobody could see it")
        return made

    def drawn(self) -> Case:
        """Draw plants until the readings change as planned.

        Raises ValueError if no plant shows them.
        """
        for attempt in range(ATTEMPTS):
            if made := _attempt(self, self.placed, self.seed + attempt * FURTHER):
                return made
        effects = " and ".join(self.effects)
        raise ValueError(f"no plant of {ATTEMPTS} shows {effects} as it should")

    @property
    def placed(self) -> list[Placed]:
        """The effects, no larger than they may be."""
        possible = possible_effects(self.layout)
        effects = ((possible[name], possible[name].effect) for name in self.effects)
        return [
            replace(placed, effect=replace(effect, high=min(effect.high, self.rarely)))
            for placed, effect in effects
        ]


@dataclass(frozen=True)
class Case:
    """A recording, and the planted effects.

    `plant` has all effects, `planted` each of them alone; `setup` is the plant without any. `drawn`
    is the seed of the successful attempt; `readings` are columns by header.
    """

    plan: Planned
    drawn: int
    setup: Setup
    plant: Plant
    planted: tuple[Planted, ...]
    readings: Mapping[str, Array]

    @functools.cached_property
    def answer(self) -> sealed.Answer:
        """The sealed answer; effects without an entry have the sort `unnamed`."""
        setup, effects = self.setup, []
        for one, gain in zip(self.planted, gains(setup, self.planted), strict=True):
            effect, key = one.placed.effect, right(one.placed, one.built)
            effects.append(
                sealed.Planted(
                    effect=effect.name,
                    title=effect.title,
                    sort=effect.sort if key["names"] else "unnamed",
                    module=one.placed.part,
                    place=effect.at,
                    **key,
                    gain=gain,
                )
            )
        return sealed.Answer(
            case=self.plan.name,
            half="dynamic",
            plant=setup.layout.name,
            profile=setup.profile,
            seed=self.plan.seed,
            samples=setup.time.size,
            verdict=sealed.verdict_of([one.sort for one in effects]),
            effects=tuple(effects),
            difficulties=setup.difficulties,
        )

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`: names and numbers in them reveal no effect."""
        write_plant(self.setup.layout, folder / "plant")
        write_csv(folder / "recording.csv", self.readings)


def _attempt(plan: Planned, wanted: list[Placed], seed: int) -> Case | None:
    """Draw one plant; None if it cannot show the effects as planned."""
    setup = build(plan.layout, seed, plan.samples, plan.profile, plan.difficulties)
    planted = plant_each(setup, wanted, seed, plan.strength)
    if planted is None:
        return None
    plant = setup.plant
    for one in planted:  # each of the size it has alone
        plant = make(setup, plant, one.placed, one.size, seed).plant
    course = run(setup, plant)
    changed = most(change_of(shown(plant, course), shown(setup.plant, setup.course)))
    clear = CLEAR if plan.strength is None else 0.0
    if not is_inside(plant, course) or (planted and changed < clear):
        return None
    alone = math.hypot(*(most(one.change) for one in planted))
    if plan.group == "hiding" and changed / alone > sealed.HIDES:
        return None
    readings = {"time [s]": setup.time, plan.layout.input_column: recorded_input(setup, seed)}
    for tank, values in shown(plant, course, seed).items():
        readings[plan.layout.columns[tank]] = values
    return Case(plan, seed, setup, plant, tuple(planted), readings)
