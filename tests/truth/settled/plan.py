"""A case to be made: what is planted, how strongly, how it is concealed; then made."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..recording import write_csv
from ..sealed import Answer, Planted, Reference, Request, verdict_of
from ..units import Array
from .effect import Made
from .effects import EFFECTS, Placed, key, places_of
from .folder import write_plant
from .reference import reference
from .rig import Rig
from .rigs import dosing_rig, oil_rig
from .scene import Scene, Stalled, scene, stream
from .term import Change
from .visible import Sight, sight

ATTEMPTS = 40
"""Plants drawn until one shows its effects as it should."""

TRIES = 14
NEAR = 1.25
"""Factor to the aimed gain that is near enough."""

LEAST = 4.0
"""Expected gain that an effect has at least."""

SAMPLES = 420, 900
SMALL = 260, 360

BEFORE = 300
"""Samples of an earlier run on which a plant is calibrated."""

HIDES = 0.8
"""Two effects hide each other: together they change less than this share of what they add up to."""


@dataclass(frozen=True)
class Planned:
    """A case to be made; the same plan gives the same bytes.

    Attributes
    ----------
    group : `clean`, `single`, `pair`, `hiding`, `fault`, `sensor`, `unnamed`, `unrecorded`
    family : `dosing` or `oil`
    effects : names, all in one plant
    aim : expected gain in log likelihood that each effect should have
    conceal : further ways in which it is concealed, of `sealed.CONCEALMENTS`
    small : two pumps at most, and a short recording
    """

    name: str
    group: str
    family: str
    profile: str
    effects: tuple[str, ...] = ()
    aim: float = 0.0
    conceal: tuple[str, ...] = ()
    small: bool = False

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
                made = _attempt(self, self.seed + 1_000_003 * attempt)
            except Stalled:
                continue
            if made is not None:
                return made
        raise ValueError(f"no plant of {ATTEMPTS} shows {self.name} as it should")


@dataclass(frozen=True)
class SettledCase:
    """A recording of a stationary plant with its answer."""

    plan: Planned
    scene: Scene
    terms: tuple[Change, ...]
    answer: Answer

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`, and `earlier.csv` to calibrate with, if any."""
        scene_, first = self.scene, self.scene.first
        write_plant(scene_.rig, folder / "plant")
        columns = scene_.recorded(scene_.truly(self.terms), self.terms)
        gone = self.answer.unrecorded
        shown = {h: v[first:] for h, v in columns.items() if not gone or f".{gone} [" not in h}
        shown["time [s]"] = shown["time [s]"] - first
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
    rig = (oil_rig if plan.family == "oil" else dosing_rig)(random, plan.small)
    placed = _placed(rig, plan.effects, random)
    if placed is None:
        return None
    samples = int(random.integers(*(SMALL if plan.small else SAMPLES)))
    before = BEFORE if _is_calibrated(plan, rig, random) else 0
    seen = sight(scene(rig, seed, samples, plan.profile, "correlated" in plan.conceal, before))
    found = []
    for one in placed:
        made = _sized(seen, one, plan.aim, seed)
        if made is None:
            return None
        found.append((one, made))
    terms = tuple(t for _, made in found for t in made.changes)
    if terms and not _possible(seen, terms):
        return None
    if plan.group == "hiding" and _added(seen, [m for _, m in found]) > HIDES:
        return None
    answer = _answer(plan, seen, found, seed)
    if answer is None:
        return None
    return SettledCase(plan, seen.scene, terms, answer)


def _is_calibrated(plan: Planned, rig: Rig, random: np.random.Generator) -> bool:
    """Every other plant is calibrated on an earlier run, with or without what is planted.

    The curve of a centrifugal pump cannot be found on a plant whose valves stay as they are.
    """
    if plan.small:
        return False
    if not set(rig.pumps.values()) <= {"cavity", "membrane"}:
        if "calibrated" in plan.conceal:
            raise Stalled("no plant to be calibrated as it runs")
        return False
    return "calibrated" in plan.conceal or bool(random.uniform() < 0.7)


def _placed(rig: Rig, effects: Sequence[str], random: np.random.Generator) -> list[Placed] | None:
    found: list[Placed] = []
    for name in effects:
        places = places_of(rig, EFFECTS[name])
        if not places:
            return None
        # Two effects are put into one module where they can be: there they hide each other.
        near = [p for p in places if p.module in [f.module for f in found]]
        places = near or places
        found.append(places[int(random.integers(len(places)))])
    return found


def _sized(seen: Sight, placed: Placed, aim: float, seed: int) -> Made | None:
    """An effect so large that it can be seen as aimed; None where that is not possible."""
    effect = placed.effect
    low, high = effect.low, effect.high
    size, best, least = math.sqrt(low * high), None, math.inf
    for _ in range(TRIES):
        made = made_of(seen.scene, placed, size, seed)
        try:
            gain = seen.gain(made.changes)
        except Stalled:
            high = size
            size = math.sqrt(low * size)
            continue
        off = abs(math.log(max(gain, 1e-9) / aim))
        if off < least:
            best, least, reached = made, off, gain
        if off < math.log(NEAR) or high / low < 1.01:
            break
        low, high = (size, high) if gain < aim else (low, size)
        guess = size * math.sqrt(aim / max(gain, 1e-9))
        size = guess if low * 1.005 < guess < high / 1.005 else math.sqrt(low * high)
    if best is None or reached < LEAST or least > math.log(4.0):
        return None
    return best


def made_of(scene_: Scene, placed: Placed, size: float, seed: int) -> Made:
    """An effect of some size; what shapes it is the same at every size."""
    # All faults begin at the same time: what else could have begun then is the rival.
    fault = placed.effect.sort == "fault"
    name = "fault" if fault else f"{placed.effect.name} {placed.module}"
    return placed.effect.make(scene_, placed.module, size, stream(seed, name))


def _possible(seen: Sight, terms: Sequence[Change]) -> bool:
    """Can the plant run so?"""
    try:
        seen.scene.truly(terms)
    except Stalled:
        return False
    return True


def _added(seen: Sight, found: Sequence[Made]) -> float:
    """What effects change together over what they change alone, root of the gains."""
    together = seen.gain([t for made in found for t in made.changes])
    alone = sum(seen.gain(made.changes) for made in found)
    return math.sqrt(together / alone)


def _answer(
    plan: Planned, seen: Sight, found: Sequence[tuple[Placed, Made]], seed: int
) -> Answer | None:
    planted = []
    for placed, made in found:
        others = [seen.change(m.changes) for p, m in found if p is not placed]
        flat = np.stack(others, 1) if others else None
        gain = seen.gain(made.changes, flat)
        margin, rival = _margin(seen, placed, made, flat, seed)
        planted.append(_planted(seen.scene.rig, placed, made, gain, margin, rival))
    sorts = [p.sort for p in planted]
    verdict = "unnamed" if plan.group == "unrecorded" else verdict_of(sorts)
    gone = found[0][0].effect.driver if plan.group == "unrecorded" else ""
    return Answer(
        plan.name,
        "stationary",
        seen.scene.rig.name,
        plan.profile,
        seed,
        seen.scene.time.size,
        verdict,
        _concealed(plan, found, planted),
        tuple(planted),
        gone,
    )


def _concealed(
    plan: Planned, found: Sequence[tuple[Placed, Made]], planted: Sequence[Planted]
) -> tuple[str, ...]:
    ways = list(plan.conceal)
    if not planted:
        ways.append("clean")
    if any(placed.effect.corner for placed, _ in found):
        ways.append("corner")
    if plan.group in ("pair", "hiding", "unrecorded", "unnamed"):
        ways.append(plan.group)
    if any(p.margin < 0.1 * p.gain for p in planted):
        ways.append("alike")
    return tuple(ways or ["open"])


def _planted(
    rig: Rig, placed: Placed, made: Made, gain: float, margin: float, rival: str
) -> Planted:
    effect, entry = placed.effect, key()[placed.effect.name]
    values = {
        name: {theirs: made.parameters[ours] for theirs, ours in map_.items()}
        for name, map_ in entry["entries"].items()
    }
    return Planted(
        effect.name,
        effect.title,
        effect.sort,
        placed.module,
        effect.title,
        tuple(entry["entries"]),
        tuple(f"{placed.module}.{place}" for place in entry["places"]),
        values,
        gain,
        margin,
        rival,
    )


def _margin(
    seen: Sight, placed: Placed, made: Made, flat: Array | None, seed: int
) -> tuple[float, str]:
    """Expected gain over the best other effect in the same module or what it feeds."""
    rig = seen.scene.rig
    near = {placed.module, *rig.path(placed.module)}
    near |= {m for m in rig.pumps if placed.module in rig.path(m)}
    least, rival = math.inf, ""
    for effect in EFFECTS.values():
        for other in places_of(rig, effect):
            if other.module not in near or other == placed or _mirrored(placed, other):
                continue
            tried = _rough(seen, other, seed)
            if tried is None:
                continue
            columns = tried[:, None] if flat is None else np.column_stack([flat, tried])
            gain = seen.gain(made.changes, columns)
            if gain < least:
                least, rival = gain, f"{other.module}.{effect.name}"
    return least, rival


def _mirrored(one: Placed, other: Placed) -> bool:
    """Is it the same with the other sign? A direction that is free in sign would not tell them."""
    faults = one.effect.sort == other.effect.sort == "fault"
    places = [key()[placed.effect.name]["places"] for placed in (one, other)]
    return faults and one.module == other.module and places[0] == places[1]


def _rough(seen: Sight, placed: Placed, seed: int) -> Array | None:
    """What another effect would change, of moderate size; None where it cannot be."""
    size = math.sqrt(placed.effect.low * placed.effect.high)
    try:
        return seen.change(made_of(seen.scene, placed, size, seed).changes)
    except Stalled:
        return None
