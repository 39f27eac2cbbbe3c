"""Readings of level sensors: first errors, then noise, then conversion."""

import numpy as np

from ..smooth import coloured
from ..streams import stream
from ..units import Array
from .balance import Course
from .drive import with_play
from .plant import LEVEL_ZERO, Plant


def shown(plant: Plant, course: Course, seed: int | None = None) -> dict[str, Array]:
    """Return the voltage of every sensor by tank; without a seed, no noise and converter steps.

    Each sensor has its own noise stream, which no effect changes.
    """
    found, time = {}, course.time
    for j, (tank, s) in enumerate(plant.sensors.items()):
        falls = course.fallen[:, plant.layout.tanks.index(tank)]
        # Inside the transmitter
        value = s["gain"] * (1.0 + s["slope"]) * course.sensed[:, j] + s["zero"] + s["offset"]
        value = value + s["drift"] * (time - time[0]) + s["jet"] * falls**2
        if s["wander"] is not None:
            first = s["zero"] / LEVEL_ZERO
            value = value + LEVEL_ZERO * (s["wander"](first, value.size) - first)
        value = value + s["steeper"] * np.maximum(value - s["bend"], 0.0)
        peaks = np.maximum.accumulate(value)
        value = value + s["kept"] * np.maximum(peaks - s["overload"], 0.0)
        if s["play"]:
            value = with_play(value, s["play"])
        if seed is not None:
            white = stream(seed, f"noise of {tank}").standard_normal(value.size)
            value = value + s["noise"] * (coloured(white, s["colour"]) if s["colour"] else white)
        # Coarse display, limits, converter, and a stuck reading last
        if s["step"]:
            value = np.round(value / s["step"]) * s["step"]
        value = np.clip(value, s["floor"], s["limit"])
        if s["converter"] and seed is not None:
            value = np.round(value / s["converter"]) * s["converter"]
        stuck = (time >= s["stuck"]) & (time < s["stuck_end"])
        found[tank] = np.where(stuck, value[np.argmax(stuck)], value)
    return found
