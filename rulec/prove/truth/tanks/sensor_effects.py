"""Errors of level sensors; their place is the tank they belong to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .effect import Built, Effect, Make, Scene, Values
from .plant import LevelSensor, Plant

Random = np.random.Generator


def _with(plant: Plant, sensor: LevelSensor, values: Values) -> Built:
    return Built(plant.with_sensor(sensor), values)


def _set(field: str, parameter: str, unit: str, sign: float = 1.0) -> Make:
    """An error that is one number of the sensor."""

    def make(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
        value = sign * size
        sensor = replace(plant.sensor(place), **{field: value})  # type: ignore[arg-type]
        return _with(plant, sensor, {parameter: (value, unit)})

    return make


def clipping(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The transmitter ends early; `size` is the share of samples that it cannot show."""
    sensor = plant.sensor(place)
    limit = round(float(np.quantile(sensor.gain * scene.levels(place), 1.0 - size)), 2)
    return _with(plant, replace(sensor, limit=limit), {"limit": (limit, "V")})


def live_zero(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The transmitter begins late; `size` is the share of samples that it cannot show."""
    sensor = plant.sensor(place)
    floor = round(float(np.quantile(sensor.gain * scene.levels(place), size)), 2)
    return _with(plant, replace(sensor, floor=floor), {"floor": (floor, "V")})


def two_slope(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """Above a voltage the gain is higher by the share `size`."""
    sensor = plant.sensor(place)
    shown = sensor.gain * scene.levels(place)
    kink = round(float(np.quantile(shown, random.uniform(0.3, 0.7))), 2)
    values = {"kink": (kink, "V"), "steeper": (size, "1")}
    return _with(plant, replace(sensor, kink=(kink, size)), values)


def overload(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """Of what a peak had above a voltage the share `size` stays on the reading."""
    sensor = plant.sensor(place)
    shown = sensor.gain * scene.levels(place)
    most = round(float(np.quantile(shown, random.uniform(0.5, 0.8))), 2)
    values = {"overload": (most, "V"), "kept": (size, "1")}
    return _with(plant, replace(sensor, overload=(most, size)), values)


def _drift(sign: float) -> Make:
    def make(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
        rate = sign * size / (scene.time_at(1.0) - scene.time_at(0.0))
        sensor = replace(plant.sensor(place), drift=rate)
        return _with(plant, sensor, {"drift": (3600.0 * rate, "V/h")})

    return make


def stuck(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The reading stays as it is for a share of the record."""
    first = random.uniform(0.1, 0.35)
    begin, end = scene.time_at(first), scene.time_at(min(first + size, 1.0))
    sensor = replace(plant.sensor(place), stuck=(begin, end))
    return Built(plant.with_sensor(sensor), {"begin": (begin, "s"), "end": (end, "s")})


def _error(
    name: str, title: str, low: float, high: float, make: Make, scale: float = 1.0
) -> Effect:
    return Effect(name, title, "sensor", "sensor", low, high, make, scale)


SENSOR_EFFECTS = (
    _error("offset-high", "reads high", 0.15, 1.4, _set("offset", "offset", "V")),
    _error("offset-low", "reads low", 0.15, 1.4, _set("offset", "offset", "V", -1.0)),
    _error("gain-high", "gain too high", 0.02, 0.4, _set("slope", "slope", "1")),
    _error("gain-low", "gain too low", 0.02, 0.4, _set("slope", "slope", "1", -1.0)),
    _error("clipping", "highest voltage", 0.01, 0.8, clipping),
    _error("live-zero", "lowest voltage", 0.01, 0.8, live_zero),
    _error("two-slope", "gain changes at a voltage", 0.05, 1.5, two_slope),
    _error("overload", "keeps a part of peaks", 0.02, 0.6, overload),
    _error("lag", "lags", 1.0, 200.0, _set("lag", "time constant", "s")),
    _error("dead-time", "shows the past", 1.0, 150.0, _set("dead_time", "dead time", "s")),
    _error("hysteresis", "play", 0.1, 6.0, _set("play", "width", "V")),
    _error("quantisation", "coarse steps", 0.4, 1.5, _set("step", "step", "V"), 0.4),
    _error("drift-up", "drifts up", 0.2, 3.0, _drift(1.0)),
    _error("drift-down", "drifts down", 0.2, 3.0, _drift(-1.0)),
    _error("stuck", "stuck for a while", 0.03, 0.6, stuck),
)
