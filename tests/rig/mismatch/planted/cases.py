"""Which explanations are planted where, how strongly; the same list in every run."""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rulec.effects.candidate import TIME, Candidate
from tests.rig.mismatch.planted.build import opened

STRENGTHS = {"weak": 0.5, "medium": 2.0, "strong": 10.0, "clear": 40.0}
"""Root mean square of a term over the noise of one sample."""

WEAK = 3
"""Every so-manyth effect is planted weakly as well: hardly any can be seen then."""

QUICK = 4
"""Every so-manyth case is in a quick run."""

LIGHT, HEAVY = ("abc", "zema", "esp"), "rig"
"""Plants that are analysed in seconds, and one that takes longer."""

CLEAN, CONSTANT, COMING, PAIRS, UNRECORDED = 40, 12, 12, 20, 10


@dataclass(frozen=True)
class Planted:
    """A case; `kind` is ``effect``, ``fault``, ``periods``, ``two``, ``hidden`` or ``clean``.

    `planted` are ids of candidates, `without` signals that are not recorded.
    """

    kind: str
    plant: str
    planted: tuple[str, ...]
    strength: str
    seed: int
    without: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Tells a case from all others."""
        what = " + ".join(self.planted) or "nothing"
        return f"{self.plant} {self.kind} {what} {self.strength} #{self.seed}"


def cases(quick: bool = False, kinds: Sequence[str] = ()) -> list[Planted]:
    """All cases, or a few of every kind."""
    found = [c for c in _all() if not kinds or c.kind in kinds]
    if not quick:
        return found
    groups = [list(g) for _, g in itertools.groupby(found, key=lambda c: c.kind)]
    return [c for group in groups for c in group[1::QUICK] if c.plant != HEAVY]


def _all() -> Iterator[Planted]:
    yield from _effects()
    yield from _faults("fault", CONSTANT)
    yield from _faults("periods", COMING)
    yield from _pairs()
    yield from _unrecorded()
    for i in range(CLEAN):
        yield Planted("clean", HEAVY if i % 10 == 9 else LIGHT[i % 3], (), "", 9000 + i)


def _effects() -> Iterator[Planted]:
    """Every effect at each strength but the weakest, over the plants in turn."""
    by_name: dict[str, dict[str, list[Candidate]]] = {}
    for plant in (*LIGHT, HEAVY):
        for candidate in opened(plant)[1].candidates:
            if candidate.sort != "fault":
                by_name.setdefault(candidate.name, {}).setdefault(plant, []).append(candidate)
    for number, (name, by_plant) in enumerate(sorted(by_name.items())):
        plants = [p for p in by_plant if p != HEAVY] or [HEAVY]
        for j, strength in enumerate(STRENGTHS):
            if strength == "weak" and number % WEAK:
                continue
            plant = plants[(number + j) % len(plants)]
            if number % 8 == j and HEAVY in by_plant:
                plant = HEAVY
            places = by_plant[plant]
            seed = _seed(name, strength)
            yield Planted("effect", plant, (places[seed % len(places)].id,), strength, seed)


def _faults(kind: str, count: int) -> Iterator[Planted]:
    for i in range(count):
        plant = LIGHT[i % 3]
        faults = [c for c in opened(plant)[1].candidates if c.sort == "fault"]
        seed = _seed(kind, str(i))
        strength = ("strong", "clear")[(i // 3) % 2]
        yield Planted(kind, plant, (faults[seed % len(faults)].id,), strength, seed)


def _pairs() -> Iterator[Planted]:
    """Two different effects in one plant."""
    for i in range(PAIRS):
        plant = LIGHT[i % 3]
        pool = [c for c in opened(plant)[1].candidates if c.sort in ("physics", "ageing")]
        seed = _seed("two", str(i))
        random = np.random.default_rng(seed)
        first = pool[int(random.integers(len(pool)))]
        others = [c for c in pool if c.name != first.name]
        second = others[int(random.integers(len(others)))]
        strength = ("medium", "strong")[(i // 3) % 2]
        yield Planted("two", plant, (first.id, second.id), strength, seed)


def _unrecorded() -> Iterator[Planted]:
    """The driver of an effect has no column."""
    for i in range(UNRECORDED):
        plant = ("abc", "esp")[i % 2]
        ruleset, builder = opened(plant)
        used = {s for o in ruleset.observers for s in o.signals}
        pool = [
            (c, tuple(d for d in c.drivers.values() if d not in used and d != TIME))
            for c in builder.candidates
            if c.sort == "physics"
        ]
        pool = [(c, drivers) for c, drivers in pool if drivers]
        seed = _seed("hidden", str(i))
        candidate, drivers = pool[seed % len(pool)]
        signals = {s.id for s in ruleset.signals}
        # What tells as much as the driver does is not recorded either.
        letters = {d.rpartition(".")[2] for d in drivers} | {"T", "mu"}
        without = tuple(sorted(s for s in signals if s.rpartition(".")[2] in letters))
        yield Planted("hidden", plant, (candidate.id,), "strong", seed, without)


def _seed(*what: str) -> int:
    return zlib.crc32(" ".join(what).encode()) % 1_000_000
