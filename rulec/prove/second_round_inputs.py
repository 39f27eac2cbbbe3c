"""Inputs of the plant in a second round: the recipe, and baselines of equal length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from rulec.prove.truth.settled.further_recording import (
    Point,
    displayed,
    held,
    recorded_further,
    repeated,
)
from rulec.prove.truth.settled.operated_plant import Scene
from rulec.prove.truth.settled.plan import SettledCase
from rulec.prove.truth.settled.solve import Stalled
from rulec.prove.truth.streams import stream
from rulec.prove.truth.units import Array

RECIPE, SAME, RANDOM = "recipe", "same", "random"

ARMS = {
    RECIPE: "as proposed",
    SAME: "the same inputs again, from the beginning of the first recording on",
    RANDOM: "as many steps, drawn within what may be set",
}
"""Ways to run the plant again, in words; all but the first are baselines."""

Held = tuple[Point, int]
"""Set points by input, and the number of samples for which they are held."""


def run_again(
    case: SettledCase, recipe: Mapping[str, Any], arm: str, seed: int
) -> dict[str, Array]:
    """Return the columns of a further recording by header, as long as the recipe.

    Steps at which the plant cannot run are left out, as an operator would. Raises ValueError if the
    recipe sets what nobody can set, or if no step is left.
    """
    if arm == SAME:
        samples = sum(samples_of(recipe, case.scene.pace))
        return recorded_further(case, repeated(case.scene, samples))
    steps = steps_of(case, recipe, arm, seed)
    try:
        return _run(case, steps)
    except Stalled:
        return _run(case, [step for step in steps if _runs(case, step)] or steps)


def _run(case: SettledCase, steps: Sequence[Held]) -> dict[str, Array]:
    points, samples = zip(*steps, strict=True)
    return recorded_further(case, held(case, points, samples))


def _runs(case: SettledCase, step: Held) -> bool:
    try:
        _run(case, [step])
    except Stalled:
        return False
    return True


def steps_of(case: SettledCase, recipe: Mapping[str, Any], arm: str, seed: int) -> list[Held]:
    """Return the set points of each step, in the units of the sensors, and its samples.

    Raises ValueError if the recipe has another unit than the sensor.
    """
    samples, points = samples_of(recipe, case.scene.pace), _points(case.scene, recipe)
    if arm == RECIPE:
        return list(zip(points, samples, strict=True))
    ranges = _ranges(case, sorted({name for point in points for name in point}))
    shares = stream(seed, "random inputs").uniform(size=(len(points), len(ranges)))
    drawn = [{**points[-1], **_within(ranges, row)} for row in shares]
    return list(zip(drawn, samples, strict=True))


def samples_of(recipe: Mapping[str, Any], pace: float) -> list[int]:
    """Return the samples of each step, at least one; `pace` is the sampling interval in s."""
    ends = [0.0, *(float(step["until"]) for step in recipe["steps"])]
    return [max(round(b / pace) - round(a / pace), 1) for a, b in pairwise(ends)]


def _points(scene: Scene, recipe: Mapping[str, Any]) -> list[Point]:
    found: list[Point] = []
    for step in recipe["steps"]:
        for name, told in step["inputs"].items():
            if told["unit"] != scene.rig.sensors[name].unit:
                raise ValueError(f"{name}: the recipe is in {told['unit']}, the sensor is not")
        found.append({name: float(told["value"]) for name, told in step["inputs"].items()})
    return found


def _ranges(case: SettledCase, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Displayed limits of the inputs, or else their range in the first recording."""
    found = {}
    for name in names:
        values = case.scene.given[name][case.scene.first :]
        ends = case.may_be_set.get(name, (values.min(), values.max()))
        if not case.may_be_set or name in case.may_be_set:
            low, high = (displayed(case, name, float(end)) for end in ends)
            found[name] = low, high
    return found


def _within(ranges: Mapping[str, tuple[float, float]], shares: Array) -> Point:
    ends = zip(ranges.items(), shares.tolist(), strict=True)
    return {name: low + share * (high - low) for (name, (low, high)), share in ends}
