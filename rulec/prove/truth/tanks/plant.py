"""The plant: tanks in a row, their feed, and the level sensors. Every effect is optional.

Lengths in cm, areas in cm2, flows in cm3/s, times in s, readings in V. A default leaves an effect
out, so `Tank(...)` with the first four values is the plain tank of a textbook.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from ..smooth import Drift, Form
from .feed import Feed

BODY_EDGE = 0.05
"""cm over which a body ends; a step would slow the solver down."""

LEVEL_ZERO = 0.025
"""V; standard uncertainty of a transmitter's zero: 0.5 % of 10 V, over 2."""

SLOT = 0.1
"""Least width of a lying cylinder's surface over its diameter, for vents and sump."""


@dataclass(frozen=True)
class Rim:
    """Overflow `strength` (h - height)**1.5; the part `caught` falls into the tank below."""

    height: float
    strength: float
    caught: float


@dataclass(frozen=True)
class Body:
    """A body in the tank that displaces liquid below a height."""

    area: float
    height: float


@dataclass(frozen=True)
class Power:
    """Outlet by (h / level)**exponent; at `level` it has the flow of the plain one."""

    exponent: float
    level: float


@dataclass(frozen=True)
class Fault:
    """Size of a fault, and its beginning in s."""

    size: float
    begin: float


@dataclass(frozen=True)
class Vortex:
    """Above `flow` an air core takes a share of the outlet, and the flow surges with `period`."""

    flow: float
    share: float
    period: float


@dataclass(frozen=True)
class Opening:
    """A hole in the wall at a height, through which liquid leaves the plant."""

    area: float
    height: float


@dataclass(frozen=True)
class Tank:
    """An open tank with a free outlet.

    Attributes
    ----------
    area : cross-section at the floor; it grows by `growth` per cm of level
    outlet : effective area of the outlet; `level` : level at the beginning
    laminar : head lost per flow, cm/(cm3/s); `power` : law of the outlet with another exponent
    height : of the outlet above the floor; `drowned` : end of its pipe above the next tank's floor
    seepage : constant loss; `leak` : an orifice to the outside; `clog` : share of the outlet lost
    cone : width gained per cm of level, in both directions; `lying` : diameter of a lying cylinder
    drain, side : orifices to the outside that are always open, at the floor and in the wall
    link : area of a second pipe to the next tank; `closing` : growth, 1/s, of its resistance
    form : form error of the outlet's law by the level
    """

    name: str
    area: float
    outlet: float
    level: float
    growth: float = 0.0
    body: Body | None = None
    laminar: float = 0.0
    power: Power | None = None
    height: float = 0.0
    drowned: float | None = None
    rim: Rim | None = None
    seepage: float = 0.0
    leak: Fault | None = None
    clog: Fault | None = None
    vortex: Vortex | None = None
    cone: float = 0.0
    lying: float = 0.0
    drain: float = 0.0
    side: Opening | None = None
    link: float = 0.0
    closing: float = 0.0
    form: Form | None = field(default=None, compare=False)

    def at(self, time: float) -> Tank:
        """Return the tank with the faults of that time, as constant properties."""
        if self.leak is None and self.clog is None:
            return self
        clogged = self.clog.size if self.clog and time >= self.clog.begin else 0.0
        leak = self.leak if self.leak and time >= self.leak.begin else None
        return replace(self, outlet=self.outlet * (1.0 - clogged), clog=None, leak=leak)

    def surface(self, level: float) -> float:
        """Return the area of the liquid's surface, cm2."""
        if self.lying:
            return self.area * _chord(self.lying, level)
        area = self.area * (1.0 + self.cone * level) ** 2 + self.growth * level
        if self.body is None:
            return area
        over = min((level - self.body.height) / BODY_EDGE, 500.0)
        return area - self.body.area / (1.0 + math.exp(over))


def _chord(diameter: float, level: float) -> float:
    """Width of a lying cylinder's surface over its diameter; a narrow slot at its ends."""
    across = 4.0 * level * (diameter - level) / diameter**2
    return math.sqrt(max(across, SLOT**2))


@dataclass(frozen=True)
class LevelSensor:
    """A level as voltage, `gain` h + `zero`, with white noise, on a converter with steps.

    Errors: `offset`, `slope` (of the gain), `lag`, `dead_time`, `play` (width of the hysteresis),
    `step` (of a coarse display), `limit` (highest voltage), `drift` (V per s), `stuck` (from, to),
    `kink` (voltage, and share by which the gain is higher above it), `floor` (lowest voltage),
    `overload` (voltage, and share of earlier peaks above it that the reading keeps), `jet` (V per
    (cm3/s)**2 of inflow; in no plain law). `colour` is the coefficient of its first-order noise,
    `wander` the drift of its zero in its class.
    """

    tank: str
    gain: float
    zero: float = 0.0
    noise: float = 0.0
    converter: float = 0.0
    offset: float = 0.0
    slope: float = 0.0
    lag: float = 0.0
    dead_time: float = 0.0
    play: float = 0.0
    step: float = 0.0
    limit: float = math.inf
    kink: tuple[float, float] = (math.inf, 0.0)
    floor: float = -math.inf
    overload: tuple[float, float] = (math.inf, 0.0)
    drift: float = 0.0
    stuck: tuple[float, float] | None = None
    jet: float = 0.0
    colour: float = 0.0
    wander: Drift | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Plant:
    """Tanks from top to bottom; the last one drains into the reservoir."""

    name: str
    feed: Feed
    tanks: tuple[Tank, ...]
    sensors: tuple[LevelSensor, ...]

    def tank(self, name: str) -> Tank:
        """Return the tank of a name."""
        return next(t for t in self.tanks if t.name == name)

    def sensor(self, tank: str) -> LevelSensor:
        """Return the sensor of a tank."""
        return next(s for s in self.sensors if s.tank == tank)

    def with_tank(self, tank: Tank) -> Plant:
        """Return the plant with the tank of the same name replaced."""
        return replace(self, tanks=tuple(tank if t.name == tank.name else t for t in self.tanks))

    def with_sensor(self, sensor: LevelSensor) -> Plant:
        """Return the plant with the sensor of the same tank replaced."""
        sensors = tuple(sensor if s.tank == sensor.tank else s for s in self.sensors)
        return replace(self, sensors=sensors)
