"""The feed of the first tank: a pump by its voltage, or a pipe with a flow meter. cm, s, V."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ..smooth import Form


@dataclass(frozen=True)
class Kink:
    """Above a voltage the flow rises more steeply, by a share."""

    voltage: float
    steeper: float


@dataclass(frozen=True)
class Curve:
    """Flow by (u / voltage)**(1 + exponent); at `voltage` it is what the plain pump gives."""

    exponent: float
    voltage: float


@dataclass(frozen=True)
class Warming:
    """The share by which the flow differs at the start, and the time constant of its decay."""

    share: float
    constant: float


@dataclass(frozen=True)
class Bypass:
    """A fast jet misses the first tank: a share of the flow, above a flow."""

    flow: float
    share: float


@dataclass(frozen=True)
class Feed:
    """Flow into the first tank by the input: `gain` (u - dead_band) (1 - droop (...)).

    `zero` is the error of the output card, `limit` the input above which the flow stays constant,
    `lag` a time constant, `delay` the time until the liquid arrives.

    `lift` (V2) is the part of the pump's head, the square of the voltage, for a height, and
    `lift_level` (V2/cm) that for the level of the first tank. `held` is the share of the flow lost
    per cm of that level, `roll` (1/V) makes the flow level off, `decline` (1/s) lets it fall with
    time. `form` is the form error of the whole law, by the voltage.

    The drive of the feed follows its input with `play` (V, its whole width) and at most at `rate`
    (V/s). `pocket` is the volume that air in the line stores per square of the flow,
    cm3/(cm3/s)2.
    """

    name: str
    gain: float
    zero: float = 0.0
    dead_band: float = 0.0
    limit: float = math.inf
    droop: float = 0.0
    lag: float = 0.0
    delay: float = 0.0
    bypass: Bypass | None = None
    lift: float = 0.0
    lift_level: float = 0.0
    held: float = 0.0
    roll: float = 0.0
    kink: Kink | None = None
    curve: Curve | None = None
    decline: float = 0.0
    warming: Warming | None = None
    form: Form | None = field(default=None, compare=False)
    play: float = 0.0
    rate: float = math.inf
    pocket: float = 0.0
