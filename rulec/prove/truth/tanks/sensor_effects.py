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
    return Built(
        plant.with_sensor(sensor), {"begin": (begin, "s"), "end": (end, "s")}, (begin, end)
    )


OUTLET, GAIN = "outlet-height of its tank, above or below zero", "another gain g: recalibration"

SENSOR_EFFECTS = (
    Effect(
        "offset-high",
        "reads high",
        "sensor",
        "sensor",
        0.15,
        1.4,
        _set("offset", "offset", "V"),
        twins=(OUTLET,),
    ),
    Effect(
        "offset-low",
        "reads low",
        "sensor",
        "sensor",
        0.15,
        1.4,
        _set("offset", "offset", "V", -1.0),
        twins=(OUTLET,),
    ),
    Effect(
        "gain-high",
        "gain too high",
        "sensor",
        "sensor",
        0.02,
        0.4,
        _set("slope", "slope", "1"),
        twins=(GAIN,),
    ),
    Effect(
        "gain-low",
        "gain too low",
        "sensor",
        "sensor",
        0.02,
        0.4,
        _set("slope", "slope", "1", -1.0),
        twins=(GAIN,),
    ),
    Effect("clipping", "highest voltage", "sensor", "sensor", 0.01, 0.8, clipping),
    Effect(
        "lag",
        "lags",
        "sensor",
        "sensor",
        1.0,
        200.0,
        _set("lag", "time constant", "s"),
        twins=("lag of the feed",),
    ),
    Effect(
        "dead-time",
        "shows the past",
        "sensor",
        "sensor",
        1.0,
        150.0,
        _set("dead_time", "dead time", "s"),
        twins=("delay of the feed",),
    ),
    Effect("hysteresis", "play", "sensor", "sensor", 0.1, 6.0, _set("play", "width", "V")),
    Effect(
        "quantisation", "coarse steps", "sensor", "sensor", 0.4, 1.5, _set("step", "step", "V"), 0.4
    ),
    Effect("drift-up", "drifts up", "sensor", "sensor", 0.2, 3.0, _drift(1.0)),
    Effect("drift-down", "drifts down", "sensor", "sensor", 0.2, 3.0, _drift(-1.0)),
    Effect("stuck", "stuck for a while", "sensor", "sensor", 0.03, 0.6, stuck),
)
