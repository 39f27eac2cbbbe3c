"""The sealed answer of a stationary case."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..sealed import Answer, Planted, verdict_of
from .detection_limit import VisibleOutputs
from .effect import WIRING, Effect, Made, Placed
from .rivals import margin_of


def answer_of(
    name: str,
    group: str,
    conceal: Sequence[str],
    seen: VisibleOutputs,
    found: Sequence[tuple[Placed, Made]],
) -> Answer:
    """Return the report of a perfect analysis; `conceal` are the requested ways of concealment."""
    planted = []
    for placed, made in found:
        others = [seen.change(m.changes) for p, m in found if p is not placed]
        flat = np.stack(others, 1) if others else np.zeros((len(seen.sensitivities), 0))
        gain = seen.gain(made.changes, flat)
        margin, rival = margin_of(seen, placed, made, flat, seen.scene.seed)
        planted.append(_planted(placed, made, gain, margin, rival))
    return _sealed(name, group, conceal, seen, [placed.effect for placed, _ in found], planted)


def connection_of(
    name: str, group: str, seen: VisibleOutputs, placed: Placed, gain: float
) -> Answer:
    """Return the same if a pipe differs from the plant file."""
    none = Made((), {}, {name: {} for name in placed.effect.entries})
    planted = _planted(placed, none, gain, float("inf"), "")
    return _sealed(name, group, ("wiring",), seen, [], [planted])


def _sealed(
    name: str,
    group: str,
    conceal: Sequence[str],
    seen: VisibleOutputs,
    effects: Sequence[Effect],
    planted: Sequence[Planted],
) -> Answer:
    scene, unrecorded = seen.scene, group == "unrecorded"
    return Answer(
        case=name,
        half="stationary",
        plant=scene.rig.name,
        profile=scene.profile,
        seed=scene.seed,
        samples=scene.time.size,
        verdict="unnamed" if unrecorded else verdict_of([p.sort for p in planted]),
        concealed=_concealed(group, conceal, effects, planted),
        effects=tuple(planted),
        unrecorded=effects[0].driver if unrecorded else "",
        difficulties=scene.hard.told,
    )


def _concealed(
    group: str,
    conceal: Sequence[str],
    effects: Sequence[Effect],
    planted: Sequence[Planted],
) -> tuple[str, ...]:
    ways = (
        ("clean", not planted),
        ("corner", any(effect.corner for effect in effects)),
        (group, group in ("pair", "hiding", "unrecorded")),
        ("wiring", any(effect.name in WIRING for effect in effects)),
        ("unnamed", any(effect.sort == "unnamed" for effect in effects)),
        ("alike", any(p.margin < 0.1 * p.gain for p in planted)),
    )
    return (*conceal, *(way for way, holds in ways if holds)) or ("open",)


def _planted(placed: Placed, made: Made, gain: float, margin: float, rival: str) -> Planted:
    effect = placed.effect
    return Planted(
        effect=effect.name,
        title=effect.title,
        sort=effect.sort,
        module=placed.module,
        place=effect.title,
        names=tuple(effect.entries),
        places=(*placed.places, *made.elsewhere),
        parameters=made.parameters,
        gain=gain,
        margin=margin,
        rival=rival,
    )
