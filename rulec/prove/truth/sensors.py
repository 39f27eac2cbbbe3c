"""Errors of sensors: one systematic per recording, a statistical one per sample.

Sensors convert from SI to trade units; their bounds are in the unit they show.
"""

import zlib
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np

from .smooth import Drift, coloured
from .streams import truncated
from .units import Array


@dataclass(frozen=True)
class Sensor:
    """Unit and uncertainty of one kind of sensor.

    Attributes
    ----------
    unit : str; `scale`, `offset` : float; SI value = shown * scale + offset
    bound : float; in the shown unit, or a fraction of the measured value if `relative`
    """

    unit: str
    scale: float
    bound: float
    offset: float = 0.0
    relative: bool = False

    def shown(self, value: Array) -> Array:
        """Convert from SI to the unit shown."""
        return (value - self.offset) / self.scale


@dataclass(frozen=True)
class Sensing:
    """The errors of the readings.

    Attributes
    ----------
    systematic : bool; whether sensors have a systematic error
    law : its distribution: `normal`, standard deviation = bound / 2, so one in 22 is out of bounds;
        `truncated`, the same but never out of bounds
    statistical : float; standard deviation of a 1 s mean over that of the systematic error;
        0.3 is an assumption, the paper publishes only the systematic bounds
    """

    systematic: bool = True
    statistical: float = 0.3
    law: Literal["normal", "truncated"] = "normal"


TABLE_1 = Sensing()
INSIDE = Sensing(law="truncated")
NOISE_FREE = Sensing(systematic=False, statistical=0.0)


def read(
    sensor: Sensor,
    place: str,
    value: Array,
    sensing: Sensing,
    seed: int,
    colour: float = 0.0,
    drift: Drift | None = None,
) -> Array:
    """Return the reading of the sensor at `place` (such as `A.dp`), in the unit it shows.

    Each sensor has its own random stream, from seed and place, and always draws both parts. So
    switching off a part or adding a module changes no other error.

    Parameters
    ----------
    value : ndarray, shape (n,), SI
    colour : coefficient of first-order noise; 0 for white noise
    drift : course of the systematic error; None if it is constant

    Source: bound taken as two standard deviations (GUM, coverage factor 2), method.md, section 2.
    """
    generator = np.random.default_rng([seed, zlib.crc32(place.encode())])
    systematic, statistical = generator.standard_normal(), generator.standard_normal(value.size)
    shown = sensor.shown(value)
    deviation = 0.5 * sensor.bound * (np.abs(shown) if sensor.relative else 1.0)
    lasting: Array | float = systematic
    if sensing.law == "truncated":
        # The quantile of the draw stays, so one seed gives similar plants under both laws.
        lasting = truncated(NormalDist().cdf(systematic))
    if drift is not None:
        lasting = drift(float(lasting), value.size)
    if colour:
        statistical = coloured(statistical, colour)
    error = sensing.systematic * lasting + sensing.statistical * statistical
    return np.asarray(shown + deviation * error)
