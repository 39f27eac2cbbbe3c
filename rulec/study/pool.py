"""Run the groups of a study, on whatever engine."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable
from functools import lru_cache

from rulec_runtime.contract.ruleset import Ruleset

from rulec.engines.call import LOCAL, Call, Engine
from rulec.engines.engine import in_order
from rulec.study.campaign import Group, Settings, run_group
from rulec.study.judge import Outcome
from rulec.study.points import Points

Scene = tuple[Ruleset, Points, Settings]
"""What all groups of a study share."""

SCENE = "scene"


def run_groups(
    ruleset: Ruleset,
    points: Points,
    settings: Settings,
    groups: Iterable[Group],
    engine: Engine,
    advance: Callable[[int], None],
) -> list[Outcome]:
    """Outcomes in the order of the groups, whatever the engine and its number of processes.

    `advance` is called with the number of recordings judged since.
    """
    if engine.kind == LOCAL and engine.jobs == 1:
        return _run_here((ruleset, points, settings), groups, advance)
    scene = pickle.dumps((ruleset, points, settings))
    calls = [Call((group,), SCENE) for group in groups]
    found = in_order(engine, run_one, calls, {SCENE: scene}, lambda own: advance(len(own)))
    return [outcome for own in found for outcome in own]


def _run_here(
    scene: Scene, groups: Iterable[Group], advance: Callable[[int], None]
) -> list[Outcome]:
    outcomes = []
    for group in groups:
        for outcome in run_group(*scene, group):
            outcomes.append(outcome)
            advance(1)
    return outcomes


def run_one(group: Group, scene: bytes) -> list[Outcome]:
    """All recordings of a group, in a process of an engine."""
    return list(run_group(*_opened(scene), group))


@lru_cache(maxsize=1)
def _opened(scene: bytes) -> Scene:
    """What the parent made; opened once, as a ruleset keeps what it has worked out."""
    found: Scene = pickle.loads(scene)
    return found
