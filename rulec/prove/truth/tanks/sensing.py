"""Readings of level sensors: first errors, then noise, then conversion."""

import numpy as np

from ..smooth import coloured
from ..streams import stream
from ..units import Array
from .balance import Course
from .drive import with_play
from .plant import LEVEL_ZERO, Numbers, Plant


def shown(plant: Plant, course: Course, seed: int | None = None) -> dict[str, Array]:
    """Return the voltage of every sensor by tank; without a seed, no noise and converter steps.

    Each sensor has its own noise stream, which no effect changes.
    """
    found = {}
    for j, (tank, sensor) in enumerate(plant.sensors.items()):
        falls = course.fallen[:, plant.layout.tanks.index(tank)]
        value = _inside(sensor, course.time, course.sensed[:, j], falls)
        if seed is not None:
            white = stream(seed, f"noise of {tank}").standard_normal(value.size)
            noise = coloured(white, sensor["colour"]) if sensor["colour"] else white
            value = value + sensor["noise"] * noise
        found[tank] = _kept(
            sensor, course.time, value, sensor["converter"] if seed is not None else 0.0
        )
    return found


def _inside(sensor: Numbers, time: Array, level: Array, falls: Array) -> Array:
    """Voltage inside the transmitter."""
    value = sensor["gain"] * (1.0 + sensor["slope"]) * level + sensor["zero"] + sensor["offset"]
    value = value + sensor["drift"] * (time - time[0]) + sensor["jet"] * falls**2
    if sensor["wander"] is not None:
        first = sensor["zero"] / LEVEL_ZERO
        value = value + LEVEL_ZERO * (sensor["wander"](first, value.size) - first)
    value = value + sensor["steeper"] * np.maximum(value - sensor["bend"], 0.0)
    over = np.maximum(np.maximum.accumulate(value) - sensor["overload"], 0.0)
    value = value + sensor["kept"] * over
    return with_play(value, sensor["play"]) if sensor["play"] else np.asarray(value)


def _kept(sensor: Numbers, time: Array, value: Array, converter: float) -> Array:
    """Recorded voltage: coarse display, limits, converter, and a stuck reading last."""
    if sensor["step"]:
        value = np.round(value / sensor["step"]) * sensor["step"]
    value = np.clip(value, sensor["floor"], sensor["limit"])
    if converter:
        value = np.round(value / converter) * converter
    stuck = (time >= sensor["stuck"]) & (time < sensor["stuck_end"])
    return np.where(stuck, value[np.argmax(stuck)], value)
