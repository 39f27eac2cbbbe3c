"""What the plant is run with in a second round: the recipe, and baselines of equal length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from rulec.prove.limits import SWEEP_HOLD
from rulec.prove.truth.settled.further import Point, displayed, held, repeated
from rulec.prove.truth.settled.plan import SettledCase
from rulec.prove.truth.settled.scene import Scene
from rulec.prove.truth.streams import stream
from rulec.prove.truth.units import Array

RECIPE, SAME, RANDOM, SWEEP = "recipe", "same", "random", "sweep"

ARMS = {
    RECIPE: "as proposed",
    SAME: "the same inputs again, from the beginning of the first recording on",
    RANDOM: "as many steps, drawn within the range of each input",
    SWEEP: "all inputs together from the lowest value to the highest",
}
"""Ways to run the plant again, in words; all but the first are baselines."""


def courses(case: SettledCase, recipe: Mapping[str, Any], arm: str, seed: int) -> dict[str, Array]:
    """Courses of all inputs, SI, each as long as the recipe asks, shape (samples,).

    Raises ValueError where the recipe sets what nobody can set.
    """
    samples, points = samples_of(recipe, case.scene.pace), _points(case.scene, recipe)
    names = sorted({name for point in points for name in point})
    match arm:
        case "recipe":
            return held(case, points, samples)
        case "same":
            return repeated(case.scene, sum(samples))
        case "random":
            drawn = stream(seed, "random inputs").uniform(size=(len(points), len(names)))
            return held(case, [_within(case, names, row) for row in drawn], samples)
        case _:
            steps = max(len(points), sum(samples) // SWEEP_HOLD)
            shares = np.linspace(0.0, 1.0, steps) if steps > 1 else np.array([0.5])
            rows = np.repeat(shares[:, None], len(names), axis=1)
            ends = np.linspace(0, sum(samples), steps + 1).astype(int)
            return held(case, [_within(case, names, row) for row in rows], np.diff(ends).tolist())


def samples_of(recipe: Mapping[str, Any], pace: float) -> list[int]:
    """Samples of each step, s from sample to sample; one at least."""
    ends = [0.0, *(float(step["until"]) for step in recipe["steps"])]
    return [max(round(b / pace) - round(a / pace), 1) for a, b in pairwise(ends)]


def _points(scene: Scene, recipe: Mapping[str, Any]) -> list[Point]:
    """Set points of each step, in the units of the sensors."""
    found: list[Point] = []
    for step in recipe["steps"]:
        for name, told in step["inputs"].items():
            if told["unit"] != scene.rig.sensors[name].unit:
                raise ValueError(f"{name}: the recipe is in {told['unit']}, the sensor is not")
        found.append({name: float(told["value"]) for name, told in step["inputs"].items()})
    return found


def _within(case: SettledCase, names: Sequence[str], shares: Array) -> Point:
    """A point at shares of the displayed ranges of inputs in the first recording."""
    point = {}
    for name, share in zip(names, shares.tolist(), strict=True):
        values = case.scene.given[name][case.scene.first :]
        low, high = (displayed(case, name, float(v)) for v in (values.min(), values.max()))
        point[name] = low + share * (high - low)
    return point
