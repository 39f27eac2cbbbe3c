"""A further recording of the same plant, which was left running: the same parameters, effects and
systematic errors of the sensors, new noise.

Signals that nobody sets continue: temperatures, levels, and pressures before and behind a valve
return the way they came; a temperature that follows the load goes on following it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..units import Array
from .drive import MEMORY, SPEED_TIME, approach
from .effect_size import made_of
from .operated_plant import SENSING, Scene
from .solve import Operated, shown_by, solve

if TYPE_CHECKING:
    from .plan import SettledCase

ROUNDS = 30
"""Iterations to find the true value behind a display."""

Point = Mapping[str, float]
"""Set points by input, in the unit of its sensor."""


def held(case: SettledCase, points: Sequence[Point], samples: Sequence[int]) -> dict[str, Array]:
    """Return the courses of all inputs, SI, with set points held for some samples each.

    The plant's own sensors show the set points. An input without a set point keeps its last value.
    Raises ValueError for a set point of a signal that is no input.
    """
    scene, courses = case.scene, {}
    unknown = {name for point in points for name in point} - set(scene.rig.inputs)
    if unknown:
        raise ValueError(f"{sorted(unknown)[0]}: nobody can set this in {scene.rig.name}")
    for name in scene.rig.inputs:
        sensor, last = scene.rig.sensors[name], float(scene.given[name][-1])
        set_ = [last]
        for point in points:
            value = point[name] * sensor.scale + sensor.offset if name in point else last
            for _ in range(ROUNDS if name in point else 0):
                value -= (displayed(case, name, value) - point[name]) * sensor.scale
            set_.append(value)
        setting = np.repeat(set_, [1, *samples])
        time = np.arange(setting.size, dtype=np.float64)
        courses[name] = approach(time, setting, SPEED_TIME)[1:]
    return courses


def displayed(case: SettledCase, name: str, value: float) -> float:
    """Return the reading of a true value, SI, without noise, in the sensor's unit."""
    scene = case.scene
    course = shown_by(case.terms, name, np.full(scene.time.size, value))
    return float(scene.read(name, course, replace(SENSING, statistical=0.0))[-1])


def repeated(scene: Scene, samples: int) -> dict[str, Array]:
    """Return the inputs again, SI, from the beginning of the recording on."""
    order = np.arange(samples) % (scene.time.size - scene.first) + scene.first
    return {name: scene.given[name][order] for name in scene.rig.inputs}


def recorded_further(case: SettledCase, courses: Mapping[str, Array]) -> dict[str, Array]:
    """Return the columns of a further recording, in the sensors' units; its clock continues.

    Raises Stalled if the plant cannot be run so.
    """
    scene = longer(case.scene, courses)
    seed = case.answer.seed
    terms = [
        term for placed, size in case.planted for term in made_of(scene, placed, size, seed).changes
    ]
    columns = scene.recorded(scene.truly(terms), terms)
    return case.shown(columns, slice(case.scene.time.size, None))


def longer(scene: Scene, courses: Mapping[str, Array]) -> Scene:
    """Continue a scene with courses of all inputs, SI."""
    rig, count = scene.rig, len(next(iter(courses.values())))
    given = {name: np.concatenate([scene.given[name], courses[name]]) for name in rig.inputs}
    around = {place: _continued(scene, place, given, count) for place in scene.around}
    added = {name: values[scene.time.size :] for name, values in given.items()}
    laws = scene.hard.terms(rig, scene.values)
    found = solve(Operated(rig, scene.values, added, laws))
    caused = {n: np.concatenate([scene.plain[n], found[n]]) for n in found if n not in given}
    return replace(
        scene,
        time=np.concatenate([scene.time, scene.time[-1] + 1.0 + np.arange(count)]),
        given=given,
        around=around,
        running=np.concatenate([scene.running, np.ones(count, dtype=bool)]),
        plain={**around, **given, **caused},
        further=count,
    )


def _continued(scene: Scene, place: str, given: Mapping[str, Array], count: int) -> Array:
    """A signal that nobody sets, continued by `count` samples beside longer inputs."""
    values, count_before, module = scene.around[place], scene.time.size, place.partition(".")[0]

    def back(values: Array) -> Array:
        """The course and its return the way it came."""
        return np.asarray(np.pad(values, (0, count), mode="symmetric"))

    if place.endswith(".p_1"):
        across = given[f"{module}.dp"]
        return np.asarray(across + back(values - across[:count_before]))
    if not (place.endswith(".T") and scene.correlated):
        return back(values)
    load = given[f"{module}.{'dp' if scene.rig.by_load else 'n'}"]
    # T rises by (a + b load - T) / MEMORY per sample; a and b follow from its course so far.
    wanted = values[:-1] + MEMORY * np.diff(values)
    slope, level = np.polyfit(load[1:count_before], wanted, 1)
    found = np.empty(count_before + count)
    found[:count_before] = values
    for k in range(count_before, count_before + count):
        found[k] = found[k - 1] + (level + slope * load[k] - found[k - 1]) / MEMORY
    return found
