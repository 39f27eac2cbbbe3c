"""True plants: parameters drawn within the uncertainties of their module types, and the input; in
hard cases form errors, coloured noise, drifts and starts at any level, which are no effects.

The numbers below repeat those of `open-tank` and `voltage-pump`, as the truth reads no file of the
tool. A test compares them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..smooth import Drift, coloured, colours, drifts, form_errors
from ..streams import stream
from ..units import Array
from .balance import Course, integrate
from .drive import DRAWN, PROFILES
from .feed import Feed
from .laws import GRAVITY
from .plant import LEVEL_ZERO, LevelSensor, Plant, Tank

NOMINAL: Mapping[str, tuple[float, float]] = {
    "k": (3.5, 1.5),
    "A": (15.0, 1.0),
    "a": (0.07, 0.03),
    "g": (0.5, 0.05),
    "h0": (8.0, 8.0),
}
"""Mean and standard deviation of drawn parameters: flow by voltage, area, outlet, gain, first
level; cm, s, V. All are within two uncertainties of the module types."""

LEAST: Mapping[str, float] = {"k": 1.0, "A": 13.0, "a": 0.015, "g": 0.4, "h0": 1.0}
"""Least drawn values; the largest is two uncertainties above the nominal one."""

CARD_ZERO, METER_SLOPE = 0.01, 0.002
"""Standard uncertainties: card 0.2 % of 10 V, flow meter 0.4 %, over 2."""

METER_NOISE = 0.3 * METER_SLOPE
"""Of a sample, as share of the reading. Source: as in `sensors.Sensing`."""

LITRE_PER_HOUR = 1000.0 / 3600.0
"""cm3/s"""

CONVERTER = 10.0 / 4096.0
"""V; 12 bit over 10 V."""


@dataclass(frozen=True)
class Layout:
    """The plant's drawing: names, measured tanks, columns.

    `metered`: the input is a flow meter, l/h, not the voltage of a pump.
    """

    name: str
    feed: str
    tanks: tuple[str, ...]
    measured: tuple[str, ...]
    metered: bool
    interval: float
    input_column: str
    columns: Mapping[str, str]


CASCADED = Layout(
    "cascaded-tanks",
    "pump",
    ("upper", "lower"),
    ("lower",),
    False,
    4.0,
    "u [V]",
    {"lower": "y [V]"},
)


STARTS = 1.0, 25.0
"""Lowest and highest first level, cm; the first reading is at most HIGHEST."""

HIGHEST = 8.0
"""V"""

ABOVE = 1.3
"""Range of a law over its value at the largest settled flow."""

Told = Mapping[str, Mapping[str, float]]
"""The difficulties in the sealed answer: sizes by law or sensor."""


@dataclass(frozen=True)
class Meter:
    """Errors of a flow meter: coefficient of its noise, and its drift."""

    colour: float = 0.0
    wander: Drift | None = None


@dataclass(frozen=True)
class Setup:
    """A plant without any effect, and its operation; `shown` is the recorded input."""

    layout: Layout
    plant: Plant
    profile: str
    time: Array
    shown: Array
    meter: Meter = field(default_factory=Meter)
    told: Told = field(default_factory=dict)

    @cached_property
    def course(self) -> Course:
        """The course of the plant, which sets the limits of effects."""
        return integrate(self.plant, self.time, self.shown)

    def levels(self, tank: str) -> Array:
        """Return the levels of a tank, cm."""
        return self.course.levels[:, self.layout.tanks.index(tank)]

    def falling(self, tank: str) -> Array:
        """Return the inflow of a tank, cm3/s."""
        return self.course.fallen[:, self.layout.tanks.index(tank)]


def build(
    layout: Layout,
    seed: int,
    samples: int = 1024,
    profile: str = "",
    difficulties: Sequence[str] = (),
) -> Setup:
    """Draw a plant, and an input that uses its range.

    Draws are repeated until the levels at the highest input are well inside tanks and sensors.
    """
    random = stream(seed, f"plant {layout.name}")
    while True:
        highest = float(random.uniform(7.2, 8.4))  # V
        plant = _drawn(layout, random)
        flow = min(
            plant.tank(s.tank).outlet * math.sqrt(2.0 * GRAVITY * ((highest - s.zero) / s.gain))
            for s in plant.sensors
        )
        if _can_work(layout, plant, flow):
            break
    kind = profile or DRAWN[int(random.integers(len(DRAWN)))]
    course = PROFILES[kind](stream(seed, f"input {layout.name}"), samples)
    time = layout.interval * np.arange(samples, dtype=np.float64)
    shown = np.round(course * flow / plant.feed.gain, 3 if layout.metered else 4)
    ranges = {t.name: _level_at(t, flow) for t in plant.tanks}
    ranges[layout.feed] = flow / plant.feed.gain
    plant, meter, told = hardened(plant, difficulties, seed, ranges, layout.metered)
    return Setup(layout, plant, kind, time, shown, meter, told)


def recorded_input(setup: Setup, seed: int) -> Array:
    """Return the input in the file: a meter adds noise, a voltage is as it was set."""
    if not setup.layout.metered:
        return setup.shown
    noise = stream(seed, "noise of the meter").standard_normal(setup.shown.size)
    if setup.meter.colour:
        noise = coloured(noise, setup.meter.colour)
    shown = setup.shown
    if setup.meter.wander is not None:
        first = (setup.plant.feed.gain / LITRE_PER_HOUR - 1.0) / METER_SLOPE
        shown = shown * (1.0 - METER_SLOPE * (setup.meter.wander(first, shown.size) - first))
    return np.asarray(shown * (1.0 + METER_NOISE * noise))


def _drawn(layout: Layout, random: np.random.Generator) -> Plant:
    if layout.metered:
        error = METER_SLOPE * _normal(random)
        feed = Feed(layout.feed, gain=LITRE_PER_HOUR * (1.0 + error))
    else:
        feed = Feed(layout.feed, gain=_draw("k", random), zero=CARD_ZERO * _normal(random))
    tanks = tuple(
        Tank(name, _draw("A", random), _draw("a", random), _draw("h0", random))
        for name in layout.tanks
    )
    sensors = tuple(
        LevelSensor(
            name,
            _draw("g", random),
            zero=LEVEL_ZERO * _normal(random),
            noise=float(random.uniform(0.01, 0.03)),
            converter=CONVERTER,
        )
        for name in layout.measured
    )
    plant = Plant(layout.name, feed, tanks, sensors)
    # The first level must be one that the sensor can show.
    highest = {s.tank: 8.0 / s.gain for s in sensors}
    return replace(
        plant,
        tanks=tuple(replace(t, level=min(t.level, highest.get(t.name, t.level))) for t in tanks),
    )


def _draw(name: str, random: np.random.Generator) -> float:
    """Draw a parameter from a normal distribution, within its bounds."""
    value, u = NOMINAL[name]
    while True:
        drawn = float(random.normal(value, u))
        if LEAST[name] <= drawn <= value + 2.0 * u:
            return drawn


def _normal(random: np.random.Generator) -> float:
    """Draw from the standard normal distribution, within the bounds of a sensor class."""
    while abs(drawn := float(random.standard_normal())) > 2.0:
        pass
    return drawn


def _level_at(tank: Tank, flow: float) -> float:
    """Level at which a plain outlet passes a flow, cm."""
    return (flow / tank.outlet) ** 2 / (2.0 * GRAVITY)


def _can_work(layout: Layout, plant: Plant, flow: float) -> bool:
    """Whether this flow can be set, and fills every tank to a useful level."""
    if not 4.0 <= flow <= 40.0:
        return False
    if not layout.metered and not 3.0 <= flow / plant.feed.gain <= 9.5:
        return False
    levels = [_level_at(t, flow) for t in plant.tanks]
    return all(8.0 <= level <= 30.0 for level in levels)


def hardened(
    plant: Plant, names: Sequence[str], seed: int, ranges: Mapping[str, float], metered: bool
) -> tuple[Plant, Meter, Told]:
    """Draw the named difficulties; `ranges` has the largest settled level of each tank, cm, and the
    largest input of a pump, V, by its name."""
    told: dict[str, dict[str, float]] = {}
    feed = plant.feed.name
    if "form" in names:
        laws = (
            (law, ((0.0, ABOVE * ranges[law]),)) for law in ranges if law != feed or not metered
        )
        forms = form_errors(seed, laws)
        told["form"] = {law: form.rms for law, form in forms.items()}
        tanks = tuple(replace(tank, form=forms[tank.name]) for tank in plant.tanks)
        plant = replace(plant, feed=replace(plant.feed, form=forms.get(feed)), tanks=tanks)
    places = [s.tank for s in plant.sensors] + [feed] * metered
    noise = colours(seed, places) if "coloured" in names else {}
    wander = drifts(seed, places) if "drift" in names else {}
    told |= {"coloured": noise} if noise else {}
    told |= {"drift": {place: one.extent for place, one in wander.items()}} if wander else {}
    sensors = (
        replace(s, colour=noise.get(s.tank, 0.0), wander=wander.get(s.tank)) for s in plant.sensors
    )
    plant = replace(plant, sensors=tuple(sensors))
    if "starts" in names:
        plant = replace(plant, tanks=tuple(_begun(plant, tank, seed) for tank in plant.tanks))
        told["starts"] = {tank.name: tank.level for tank in plant.tanks}
    return plant, Meter(noise.get(feed, 0.0), wander.get(feed)), told


def _begun(plant: Plant, tank: Tank, seed: int) -> Tank:
    level = float(stream(seed, f"start {tank.name}").uniform(*STARTS))
    most = [HIGHEST / s.gain for s in plant.sensors if s.tank == tank.name]
    return replace(tank, level=min([level, *most]))
