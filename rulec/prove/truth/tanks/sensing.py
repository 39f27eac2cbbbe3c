"""Readings of level sensors: first errors, then noise, then conversion."""

import zlib

import numpy as np

from ..smooth import coloured
from ..units import Array
from .balance import Course
from .drive import with_play
from .plant import LEVEL_ZERO, LevelSensor, Plant


def shown(plant: Plant, course: Course, seed: int | None = None) -> dict[str, Array]:
    """Return the voltage of every sensor by tank; without a seed, no noise and converter steps."""
    names = [t.name for t in plant.tanks]
    result = {}
    for j, sensor in enumerate(plant.sensors):
        falls = course.fallen[:, names.index(sensor.tank)]
        value = _value(sensor, course.time, course.sensed[:, j], falls)
        result[sensor.tank] = _kept(sensor, course.time, value, seed)
    return result


def _value(sensor: LevelSensor, time: Array, level: Array, falls: Array) -> Array:
    """Voltage inside the transmitter."""
    value = sensor.gain * (1.0 + sensor.slope) * level + sensor.zero + sensor.offset
    value = value + sensor.drift * (time - time[0]) + sensor.jet * falls**2
    if sensor.wander is not None:
        first = sensor.zero / LEVEL_ZERO
        value = value + LEVEL_ZERO * (sensor.wander(first, value.size) - first)
    bend, steeper = sensor.kink
    value = value + steeper * np.maximum(value - bend, 0.0)
    most, kept = sensor.overload
    value = value + kept * np.maximum(np.maximum.accumulate(value) - most, 0.0)
    return with_play(value, sensor.play) if sensor.play else value


def _kept(sensor: LevelSensor, time: Array, value: Array, seed: int | None) -> Array:
    """Recorded voltage: noise, coarse display, limits, converter, and a stuck reading last.

    Each sensor has its own noise stream, which no effect changes.
    """
    if seed is not None:
        stream = np.random.default_rng([seed, zlib.crc32(f"noise of {sensor.tank}".encode())])
        white = stream.standard_normal(value.size)
        value = value + sensor.noise * (coloured(white, sensor.colour) if sensor.colour else white)
    if sensor.step:
        value = np.round(value / sensor.step) * sensor.step
    value = np.clip(value, sensor.floor, sensor.limit)
    if sensor.converter and seed is not None:
        value = np.round(value / sensor.converter) * sensor.converter
    if sensor.stuck is not None:
        begin, end = sensor.stuck
        stuck = (time >= begin) & (time < end)
        value = np.where(stuck, value[np.argmax(stuck)], value)
    return value
