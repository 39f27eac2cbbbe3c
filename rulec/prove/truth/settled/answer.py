"""The sealed answer of a stationary case."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..sealed import Answer, Planted, verdict_of
from .effect import Made
from .effects import WIRING, Placed, entry_of
from .rig import Rig
from .rivals import margin_of
from .visible import Sight


def answer_of(
    name: str,
    group: str,
    conceal: Sequence[str],
    seen: Sight,
    found: Sequence[tuple[Placed, Made]],
    seed: int,
) -> Answer:
    """What a perfect analysis would say; `conceal` are ways of concealing that were asked for."""
    planted = []
    for placed, made in found:
        others = [seen.change(m.changes) for p, m in found if p is not placed]
        flat = np.stack(others, 1) if others else np.zeros((len(seen.sensitivities), 0))
        gain = seen.gain(made.changes, flat)
        margin, rival = margin_of(seen, placed, made, flat, seed)
        planted.append(_planted(seen.scene.rig, placed, made, gain, margin, rival))
    sorts = [p.sort for p in planted]
    verdict = "unnamed" if group == "unrecorded" else verdict_of(sorts)
    gone = found[0][0].effect.driver if group == "unrecorded" else ""
    return Answer(
        case=name,
        half="stationary",
        plant=seen.scene.rig.name,
        profile=seen.scene.profile,
        seed=seed,
        samples=seen.scene.time.size,
        verdict=verdict,
        concealed=_concealed(group, conceal, found, planted),
        effects=tuple(planted),
        unrecorded=gone,
        difficulties=seen.scene.hard.told,
    )


def connection_of(name: str, group: str, seen: Sight, placed: Placed, gain: float) -> Answer:
    """The same where a pipe is not as the plant file says."""
    rig = seen.scene.rig
    planted = _planted(rig, placed, Made((), {}), gain, float("inf"), "")
    return Answer(
        case=name,
        half="stationary",
        plant=rig.name,
        profile=seen.scene.profile,
        seed=seen.scene.seed,
        samples=seen.scene.time.size,
        verdict=verdict_of([planted.sort]),
        concealed=_concealed(group, ("wiring",), [], [planted]),
        effects=(planted,),
    )


def _concealed(
    group: str,
    conceal: Sequence[str],
    found: Sequence[tuple[Placed, Made]],
    planted: Sequence[Planted],
) -> tuple[str, ...]:
    ways = list(conceal)
    if not planted:
        ways.append("clean")
    if any(placed.effect.corner for placed, _ in found):
        ways.append("corner")
    if group in ("pair", "hiding", "unrecorded"):
        ways.append(group)
    if any(placed.effect.name in WIRING for placed, _ in found):
        ways.append("wiring")
    if any(placed.effect.sort == "unnamed" for placed, _ in found):
        ways.append("unnamed")
    if any(p.margin < 0.1 * p.gain for p in planted):
        ways.append("alike")
    return tuple(ways or ["open"])


def _planted(
    rig: Rig, placed: Placed, made: Made, gain: float, margin: float, rival: str
) -> Planted:
    effect, entry = placed.effect, entry_of(placed.effect.name)
    values = {
        name: {theirs: made.parameters[ours] for theirs, ours in map_.items()}
        for name, map_ in entry["entries"].items()
    }
    return Planted(
        effect=effect.name,
        title=effect.title,
        sort=effect.sort,
        module=placed.module,
        place=effect.title,
        names=tuple(entry["entries"]),
        places=(*(f"{placed.module}.{place}" for place in entry["places"]), *made.elsewhere),
        parameters=values,
        gain=gain,
        margin=margin,
        rival=rival,
    )
