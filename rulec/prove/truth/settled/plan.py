"""A case to be made: what is planted, how strongly, how it is concealed; then made."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..limit import expected_gain
from ..recording import write_csv
from ..sealed import HIDES, Answer, Reference, Request
from ..streams import FURTHER, stream
from .answer import answer_of, connection_of
from .blurred import blurred
from .connection_effects import WAYS
from .drive import PRODUCTION
from .effect import Made
from .effects import Placed, effect_of, places_of
from .folder import write_limits, write_plant
from .reference import reference
from .rig import Rig
from .rigs import bench_rig, dosing_rig, oil_rig, valve_rig, warm_rig
from .scene import Scene, may_be_set, scene
from .sized import sized
from .solve import Stalled
from .term import Change
from .visible import VisibleOutputs, sight

FAMILIES = {
    "dosing": dosing_rig,
    "oil": oil_rig,
    "bench": bench_rig,
    "warm": warm_rig,
    "valve": valve_rig,
}
"""Kinds of plants, by how they are drawn."""

ATTEMPTS = 40
"""Plants drawn until one shows its effects as it should."""

SAMPLES = 420, 900
SMALL = 260, 360

PACES = 60.0, 3600.0
"""Seconds from sample to sample where what is planted takes days."""

BEFORE = 300
"""Samples of an earlier run on which a plant is calibrated."""


@dataclass(frozen=True)
class Planned:
    """A case to be made; the same plan gives the same bytes.

    Attributes
    ----------
    group : `clean`, `single`, `pair`, `hiding`, `fault`, `sensor`, `unnamed`, `unrecorded`,
        `connection` or another of the suite
    family : `dosing`, `oil`, `warm`, `bench` or `valve`
    effects : names, all in one plant
    aim : expected gain in log likelihood that each effect should have
    conceal : further ways in which it is concealed, of `sealed.CONCEALMENTS`
    small : two pumps at most, and a short recording
    difficulties : what makes it harder, of `sealed.DIFFICULTIES`
    """

    name: str
    group: str
    family: str
    profile: str
    effects: tuple[str, ...] = ()
    aim: float = 0.0
    conceal: tuple[str, ...] = ()
    small: bool = False
    difficulties: tuple[str, ...] = ()

    @property
    def seed(self) -> int:
        """Fixed by the name."""
        return zlib.crc32(self.name.encode())

    def make(self) -> SettledCase:
        """Draw plants until the effects show as they should.

        Raises ValueError where none does.
        """
        for attempt in range(ATTEMPTS):
            try:
                made = _attempt(self, self.seed + FURTHER * attempt)
            except Stalled:
                continue
            if made is not None:
                return made
        raise ValueError(f"no plant of {ATTEMPTS} shows {self.name} as it should")


@dataclass(frozen=True)
class SettledCase:
    """A recording of a stationary plant with its answer; `planted` are effects with their sizes."""

    plan: Planned
    scene: Scene
    terms: tuple[Change, ...]
    answer: Answer
    stated: Rig | None = None
    """The plant as its file has it, where that is another one."""
    planted: tuple[tuple[Placed, float], ...] = ()

    @property
    def may_be_set(self) -> dict[str, tuple[float, float]]:
        """How far inputs may be set, SI, where that is farther than was recorded."""
        return may_be_set(self.scene.rig) if self.plan.profile == PRODUCTION else {}

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`, `earlier.csv` to calibrate with, if any, and
        `limits.yaml` where more may be set than was recorded."""
        scene_, first = self.scene, self.scene.first
        write_plant(self.stated or scene_.rig, folder / "plant")
        if self.may_be_set:
            write_limits(scene_.rig, self.may_be_set, folder / "limits.yaml")
        columns = scene_.recorded(scene_.truly(self.terms), self.terms)
        gone = self.answer.unrecorded
        shown = {h: v[first:] for h, v in columns.items() if not gone or f".{gone} [" not in h}
        shown["time [s]"] = shown["time [s]"] - scene_.clock[first]
        write_csv(folder / "recording.csv", shown)
        if first:
            terms = self.terms if "calibrated" in self.plan.conceal else ()
            earlier = scene_.recorded(scene_.truly(terms), terms)
            write_csv(folder / "earlier.csv", {h: v[:first] for h, v in earlier.items()})

    def reference(self, request: Request) -> Reference:
        """The true model on held-out samples, and the course of what is not recorded."""
        module = self.answer.effects[0].module if self.answer.effects else ""
        return reference(self.scene, self.terms, self.answer.unrecorded, request, module)


def _attempt(plan: Planned, seed: int) -> SettledCase | None:
    """One plant; None where an effect cannot be, or be seen, in it."""
    random = stream(seed, "plan")
    rig = FAMILIES[plan.family](random, plan.small)
    if plan.group == "connection":
        return _misstated(plan, rig, seed, random)
    placed = _placed(rig, plan.effects, random)
    if placed is None:
        return None
    samples = int(random.integers(*(SMALL if plan.small else SAMPLES)))
    before = BEFORE if _is_calibrated(plan, rig, random) else 0
    correlated = "correlated" in plan.conceal
    pace = _pace(plan, seed)
    drawn = scene(rig, seed, samples, plan.profile, correlated, before, plan.difficulties, pace)
    seen = sight(drawn)
    found = []
    for one in placed:
        made = sized(seen, one, plan.aim, seed)
        if made is None:
            return None
        found.append((one, made))
    terms = tuple(t for _, made in found for t in made.changes)
    if terms and not _possible(seen, terms):
        return None
    if plan.group == "hiding" and _added(seen, [m for _, m in found]) > HIDES:
        return None
    # Effects are as strong as their case asks on a plant that keeps to its laws: what difficulties
    # hide of them is told, not made up for.
    told = blurred(seen) if found and drawn.hard.told else seen
    answer = answer_of(plan.name, plan.group, plan.conceal, told, found)
    planted = tuple((one, made.size) for one, made in found)
    return SettledCase(plan, seen.scene, terms, answer, planted=planted)


def _misstated(
    plan: Planned, rig: Rig, seed: int, random: np.random.Generator
) -> SettledCase | None:
    """A plant that is connected otherwise than its file says; None where that does not show."""
    (name,) = plan.effects
    true, stated, module = WAYS[name](rig, random)
    samples = int(random.integers(*(SMALL if plan.small else SAMPLES)))
    drawn = scene(true, seed, samples, plan.profile)
    seen = sight(drawn)
    believed = replace(drawn, rig=stated).truly()
    off = seen.over({n: drawn.plain[n] - believed[n] for n in true.outputs})
    gain = expected_gain(off, seen.sensitivities, np.zeros((len(off), 0)))
    if gain < plan.aim:
        return None
    answer = connection_of(plan.name, plan.group, seen, Placed(effect_of(name), module), gain)
    return SettledCase(plan, drawn, (), answer, stated)


def _pace(plan: Planned, seed: int) -> float:
    """Seconds from sample to sample: what fouls, wears or creeps is not seen within minutes."""
    if not any(effect_of(name).slow for name in plan.effects):
        return 1.0
    low, high = (math.log(pace) for pace in PACES)
    return round(math.exp(stream(seed, "pace").uniform(low, high)))


def _is_calibrated(plan: Planned, rig: Rig, random: np.random.Generator) -> bool:
    """Every other plant is calibrated on an earlier run, with or without what is planted.

    The curve of a centrifugal pump cannot be found on a plant whose valves stay as they are.
    """
    # Of a plant whose laws have errors nobody knows parameters but those that a run has shown.
    if plan.small and "form" not in plan.difficulties:
        return False
    if not set(rig.pumps.values()) <= {"cavity", "membrane"}:
        if "calibrated" in plan.conceal:
            raise Stalled("no plant to be calibrated as it runs")
        return False
    return "calibrated" in plan.conceal or bool(random.uniform() < 0.7)


def _placed(rig: Rig, effects: Sequence[str], random: np.random.Generator) -> list[Placed] | None:
    found: list[Placed] = []
    for name in effects:
        places = places_of(rig, effect_of(name))
        if not places:
            return None
        # Two effects are put into one module where they can be: there they hide each other.
        near = [p for p in places if p.module in [f.module for f in found]]
        places = near or places
        found.append(places[int(random.integers(len(places)))])
    return found


def _possible(seen: VisibleOutputs, terms: Sequence[Change]) -> bool:
    """Can the plant run so?"""
    try:
        seen.scene.truly(terms)
    except Stalled:
        return False
    return True


def _added(seen: VisibleOutputs, found: Sequence[Made]) -> float:
    """What effects change together over what they change alone, root of the gains."""
    together = seen.gain([t for made in found for t in made.changes])
    alone = sum(seen.gain(made.changes) for made in found)
    return math.sqrt(together / alone)
