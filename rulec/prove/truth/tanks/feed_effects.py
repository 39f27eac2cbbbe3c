"""Effects of what feeds the first tank: a pump by its voltage, or a pipe with a flow meter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .effect import Built, Effect, Scene, Values, quantile
from .feed import Feed
from .plant import Plant

Random = np.random.Generator


def _with(plant: Plant, feed: Feed, values: Values) -> Built:
    return Built(replace(plant, feed=feed), values)


def dead_band(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The first `size` volts move nothing."""
    return _with(plant, replace(plant.feed, dead_band=size), {"dead band": (size, "V")})


def saturation(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """More voltage gives no more flow; `size` is how often that would be asked for."""
    limit = quantile(scene.setup.shown, 1.0 - size)
    return _with(plant, replace(plant.feed, limit=limit), {"limit": (limit, "V")})


def droop(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The flow by voltage bends down; `size` is the share that is missing at the highest."""
    per_volt = size / float(scene.setup.shown.max())
    return _with(plant, replace(plant.feed, droop=per_volt), {"droop": (per_volt, "1/V")})


def lag(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The flow follows its input with a time constant."""
    return _with(plant, replace(plant.feed, lag=size), {"time constant": (size, "s")})


def delay(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """A long hose runs partly empty: all flow arrives later."""
    return _with(plant, replace(plant.feed, delay=size), {"delay": (size, "s")})


def play(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The drive of the pump has play, `size` volts wide."""
    return _with(plant, replace(plant.feed, play=size), {"width": (size, "V")})


def rate(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """The drive takes `size` seconds to the usual voltage."""
    usual = quantile(scene.setup.shown, 0.5)
    return _with(plant, replace(plant.feed, rate=usual / size), {"running time": (size, "s")})


def pocket(scene: Scene, plant: Plant, place: str, size: float, random: Random) -> Built:
    """Air in the line yields; `size` is the time constant at the usual flow."""
    usual = quantile(scene.course.fed, 0.5)
    stored = 0.5 * size / usual
    return _with(plant, replace(plant.feed, pocket=stored), {"time constant": (size, "s")})


FEED_EFFECTS = (
    Effect("dead-band", "dead band", "physics", "feed", 0.02, 3.0, dead_band),
    Effect("saturation", "saturation", "physics", "feed", 0.01, 0.9, saturation),
    Effect("droop", "flow bends down with the input", "physics", "feed", 0.01, 0.45, droop),
    Effect("lag", "flow lags", "physics", "feed", 1.0, 200.0, lag),
    Effect("delay", "flow is delayed", "physics", "feed", 1.0, 150.0, delay),
    Effect("play", "drive has play", "physics", "feed", 0.02, 4.0, play),
    Effect("rate", "drive moves slowly", "physics", "feed", 1.0, 600.0, rate),
    Effect("pocket", "air in the line", "physics", "feed", 1.0, 300.0, pocket),
)
