"""A planned case (its effects and their strength), how it is made, and its answer."""

from __future__ import annotations

import contextlib
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..recording import write_csv
from ..sealed import HIDES, Answer, Planted, verdict_of
from ..smooth import between
from ..streams import FURTHER, stream
from ..units import Array
from .detection_limit import VisibleOutputs, visible_outputs
from .drive import PRODUCTION
from .effect import Made, Placed, effect_of, places_of
from .effect_size import sized
from .operated_plant import Scene, may_be_set, scene
from .rig import Rig
from .rigs import drawn_rig, write_limits, write_plant
from .solve import Stalled, Term

ATTEMPTS = 40
"""Most plants that are drawn until one shows its effects as planned."""

SAMPLES = 420, 900
SMALL = 260, 360

PACES = 60.0, 3600.0
"""Range of the sampling interval in s if an effect takes days."""

BEFORE = 300
"""Samples of an earlier run on which a plant is calibrated."""


@dataclass(frozen=True)
class Planned:
    """A case to be made; the same plan gives the same bytes.

    Attributes
    ----------
    group : of `cases.yaml`
    family : `dosing`, `oil`, `warm`, `bench` or `valve`
    effects : names, all in one plant
    aim : target of the expected gain in log likelihood of each effect
    conceal : `calibrated` on data that contain the effect, or `correlated` drivers; or neither
    small : at most two pumps, and a short recording
    difficulties : of `cases.yaml`
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
        """Hash of the name."""
        return zlib.crc32(self.name.encode())

    def make(self) -> SettledCase:
        """Draw plants until the effects show as planned.

        Raises ValueError if none does.
        """
        for attempt in range(ATTEMPTS):
            with contextlib.suppress(Stalled):
                return _attempt(self, self.seed + FURTHER * attempt)
        raise ValueError(f"no plant of {ATTEMPTS} shows {self.name} as it should")


@dataclass(frozen=True)
class SettledCase:
    """A recording of a stationary plant with its answer; `planted` are effects with their sizes."""

    plan: Planned
    scene: Scene
    terms: tuple[Term, ...]
    answer: Answer
    planted: tuple[tuple[Placed, float], ...]

    @property
    def may_be_set(self) -> dict[str, tuple[float, float]]:
        """Limits of the inputs, SI, if they are wider than the recording."""
        return may_be_set(self.scene.rig) if self.plan.profile == PRODUCTION else {}

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`, `earlier.csv` for a calibration, if any, and
        `limits.yaml` if inputs may be set beyond the recording."""
        scene_, first = self.scene, self.scene.first
        write_plant(scene_.rig, folder / "plant")
        if self.may_be_set:
            write_limits(scene_.rig, self.may_be_set, folder / "limits.yaml")
        columns = scene_.recorded(scene_.truly(self.terms), self.terms)
        write_csv(folder / "recording.csv", self.shown(columns, slice(first, None)))
        if first:
            terms = self.terms if "calibrated" in self.plan.conceal else ()
            earlier = scene_.recorded(scene_.truly(terms), terms)
            write_csv(folder / "earlier.csv", {h: v[:first] for h, v in earlier.items()})

    def shown(self, columns: Mapping[str, Array], part: slice) -> dict[str, Array]:
        """Return some samples of the recorded columns, with time since the recording began."""
        gone = self.answer.unrecorded
        found = {h: v[part] for h, v in columns.items() if not gone or f".{gone} [" not in h}
        return {**found, "time [s]": found["time [s]"] - self.scene.clock[self.scene.first]}


def _attempt(plan: Planned, seed: int) -> SettledCase:
    """Draw one plant; raises Stalled if it cannot have or show an effect, or cannot run so."""
    random = stream(seed, "plan")
    rig = drawn_rig(plan.family, random, plan.small)
    placed = _placed(rig, plan.effects, random)
    samples = int(random.integers(*(SMALL if plan.small else SAMPLES)))
    before = BEFORE if _is_calibrated(plan, rig, random) else 0
    correlated = "correlated" in plan.conceal
    # Fouling, wear and creep do not show within minutes.
    slow = any(effect_of(name).slow for name in plan.effects)
    pace = round(between(stream(seed, "pace"), PACES)) if slow else 1.0
    drawn = scene(rig, seed, samples, plan.profile, correlated, before, plan.difficulties, pace)
    visible = visible_outputs(drawn)
    found = [(one, sized(visible, one, plan.aim, seed)) for one in placed]
    terms = tuple(t for _, made in found for t in made.changes)
    if terms:
        drawn.truly(terms)  # Stalled if it cannot run with all of them
    if plan.group == "hiding":
        alone = sum(visible.gain(made.changes) for _, made in found)
        if math.sqrt(visible.gain(terms) / alone) > HIDES:
            raise Stalled("the effects do not hide each other")
    planted = tuple((one, made.size) for one, made in found)
    return SettledCase(plan, drawn, terms, _answer(plan, visible, found), planted)


def _is_calibrated(plan: Planned, rig: Rig, random: np.random.Generator) -> bool:
    """Whether the plant is calibrated on an earlier run, with or without the planted effects.

    The curve of a centrifugal pump cannot be calibrated while the valves of the plant stay fixed.
    """
    # If laws have form errors, an earlier run is the only source of parameters.
    if plan.small and "form" not in plan.difficulties:
        return False
    if not set(rig.pumps.values()) <= {"cavity", "membrane"}:
        if "calibrated" in plan.conceal:
            raise Stalled("no plant to be calibrated as it runs")
        return False
    return "calibrated" in plan.conceal or bool(random.uniform() < 0.7)


def _placed(rig: Rig, effects: Sequence[str], random: np.random.Generator) -> list[Placed]:
    found: list[Placed] = []
    for name in effects:
        places = places_of(rig, effect_of(name))
        if not places:
            raise Stalled(f"no place for {name}")
        # Two effects are put into one module if possible, as they hide each other there.
        places = [p for p in places if p.module in [f.module for f in found]] or places
        found.append(places[int(random.integers(len(places)))])
    return found


def _answer(plan: Planned, visible: VisibleOutputs, found: Sequence[tuple[Placed, Made]]) -> Answer:
    """The report of a perfect analysis."""
    scene, unrecorded = visible.scene, plan.group == "unrecorded"
    planted = [
        Planted(
            effect=placed.effect.name,
            title=placed.effect.title,
            sort=placed.effect.sort,
            module=placed.module,
            place=placed.effect.title,
            names=tuple(placed.effect.entries),
            places=(*placed.places, *made.elsewhere),
            parameters=made.parameters,
            gain=visible.gain(made.changes, [m.changes for p, m in found if p is not placed]),
        )
        for placed, made in found
    ]
    return Answer(
        case=plan.name,
        half="stationary",
        plant=scene.rig.name,
        profile=scene.profile,
        seed=scene.seed,
        samples=scene.time.size,
        verdict="unnamed" if unrecorded else verdict_of([p.sort for p in planted]),
        effects=tuple(planted),
        unrecorded=found[0][0].effect.driver if unrecorded else "",
        difficulties=scene.hard.sizes,
    )
