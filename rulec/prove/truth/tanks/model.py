"""A true plant as a model: expected readings over their noise, and their derivatives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..units import Array
from .balance import Course, integrate
from .plant import LevelSensor, Plant
from .sensing import shown
from .varied_parameters import Knob

ONLY_READ = ("gain", "zero")
"""Parameters of a sensor that do not change the course of a plant."""


@dataclass(frozen=True)
class Model:
    """Operation of a plant: time, s, and recorded input, both of shape (samples,)."""

    time: Array
    given: Array

    def course(self, plant: Plant) -> Course:
        """Simulate a plant."""
        return integrate(plant, self.time, self.given, quick=True)

    def alike(self, plant: Plant, course: Course, other: Plant) -> Course:
        """Simulate another plant; the course is the same if only its readings differ."""
        same = (plant.feed, plant.tanks) == (other.feed, other.tanks)
        follow = any(s.lag or s.dead_time for s in (*plant.sensors, *other.sensors))
        return course if same and not follow else self.course(other)

    def readings(self, plant: Plant, course: Course) -> Array:
        """Return noise-free readings over their noise, sensor by sensor, shape (n,), 1."""
        values = shown(plant, course)
        return np.concatenate([values[s.tank] / noise_of(s) for s in plant.sensors])

    def slopes(self, plant: Plant, course: Course, knobs: Sequence[Knob]) -> Array:
        """Return the derivatives of the readings by each knob, shape (n, knobs).

        They are forward differences.
        """
        plain = self.readings(plant, course)
        columns = []
        for knob in knobs:
            step = knob.step(plant)
            turned = knob.set(plant, knob.of(plant) + step)
            only_read = knob.path[0] == "sensors" and knob.path[-1] in ONLY_READ
            happens = course if only_read else self.course(turned)
            columns.append((self.readings(turned, happens) - plain) / step)
        return np.column_stack(columns)


def noise_of(sensor: LevelSensor) -> float:
    """Return the standard deviation of a reading, V: white noise and steps of the converter.

    A step is uniform, GUM 4.3.7; coarse steps are an effect instead.
    """
    return math.hypot(sensor.noise, sensor.converter / math.sqrt(12.0))
