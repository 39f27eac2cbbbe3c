"""Named cases, the same in every run: none, one, two effects, faults, sensors, unnamed."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .build import CASCADED, ROW, Layout
from .case import Case, case
from .effects import possible_effects

CLEAN: Mapping[str, int] = {CASCADED.name: 24, ROW.name: 12}
"""Cases without any effect in a round."""

HIDING = (
    ("upper.overflow-sharp", "lower.y.clipping"),
    ("upper.overflow-sharp", "lower.laminar"),
    ("upper.overflow-sharp", "lower.power-low"),
    ("lower.overflow-broad", "lower.power-low"),
    ("pump.dead-band", "lower.laminar"),
    ("pump.dead-band", "lower.y.offset-high"),
    ("pump.droop", "lower.power-low"),
    ("upper.seepage", "lower.y.gain-high"),
    ("upper.seepage", "lower.y.offset-high"),
    ("upper.seepage", "lower.y.jet"),
    ("upper.seepage", "lower.clogging"),
    ("upper.leak", "lower.clogging"),
    ("upper.leak", "lower.y.drift-up"),
    ("lower.clogging", "lower.y.drift-down"),
)
"""Together they show less than they add up to."""

PAIRS: Mapping[str, tuple[tuple[str, str], ...]] = {
    CASCADED.name: (
        ("upper.overflow-broad", "pump.saturation"),
        ("lower.growing-area", "pump.lag"),
        ("pump.delay", "lower.y.lag"),
        ("upper.vortex", "lower.overflow-broad"),
    ),
    ROW.name: (
        ("first.overflow-sharp", "last.laminar"),
        ("middle.seepage", "first.y.drift-up"),
        ("inflow.delay", "last.clogging"),
    ),
}

GROUPS = ("clean", "single", "sensor", "fault", "unnamed", "hiding", "pair")


@dataclass(frozen=True)
class Named:
    """A case to be made."""

    group: str
    layout: Layout
    effects: tuple[str, ...]
    number: int

    @property
    def name(self) -> str:
        """Tells a case from all others; the stem of its files."""
        planted = ["+".join(self.effects)] if self.effects else []
        return "-".join([self.layout.name, self.group, *planted, str(self.number)])

    @property
    def seed(self) -> int:
        """Fixed by the name."""
        return zlib.crc32(self.name.encode())

    def make(self, samples: int = 1024) -> Case:
        """Simulate it."""
        hiding = self.group == "hiding"
        return case(self.seed, self.effects, samples, self.layout, self.name, hiding)


def named(
    rounds: int = 1, clean: Mapping[str, int] = CLEAN, groups: tuple[str, ...] = GROUPS
) -> Iterator[Named]:
    """All cases of some rounds; each round draws other plants, inputs and sizes."""
    for number in range(rounds):
        for layout in (CASCADED, ROW):
            wanted = [("clean", ())] * clean.get(layout.name, 0) + [*_planted(layout, number)]
            for i, (group, effects) in enumerate(wanted):
                if group in groups:
                    yield Named(group, layout, effects, number if effects else number * 1000 + i)


def _planted(layout: Layout, number: int) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Groups and effects: every effect of the two tanks everywhere, of the row at one place."""
    places: dict[str, list[tuple[str, str]]] = {}
    for id_, placed in possible_effects(layout).items():
        group: str = "single" if placed.effect.sort == "physics" else placed.effect.sort
        places.setdefault(f"{placed.effect.at} {placed.effect.name}", []).append((group, id_))
    for turn, found in enumerate(places.values(), start=number):
        chosen = found if layout == CASCADED else [found[turn % len(found)]]
        for group, id_ in chosen:
            yield group, (id_,)
    if layout == CASCADED:
        yield from (("hiding", pair) for pair in HIDING)
    yield from (("pair", pair) for pair in PAIRS[layout.name])
