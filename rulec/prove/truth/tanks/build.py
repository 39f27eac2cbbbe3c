"""True plants: parameters drawn within the uncertainties of their module types, and the input; in
hard cases form errors, coloured noise, drifts and starts at any level, which are no effects.

The numbers below repeat those of `open-tank` and `voltage-pump`, as the truth reads no file of the
tool. A test compares them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..smooth import coloured, colours, drifts, form_errors
from ..streams import stream
from ..units import Array
from .balance import Course, integrate
from .drive import DRAWN, PROFILES
from .plant import GRAVITY, LEVEL_ZERO, SENSOR, Layout, Numbers, Plant

NOMINAL: Mapping[str, tuple[float, float, float]] = {
    "k": (3.5, 1.5, 1.0),
    "A": (15.0, 1.0, 13.0),
    "a": (0.07, 0.03, 0.015),
    "g": (0.5, 0.05, 0.4),
    "h0": (8.0, 8.0, 1.0),
}
"""Mean, standard deviation and least value of drawn parameters: flow by voltage, area, outlet,
gain, first level; cm, s, V. The largest value is two uncertainties above the nominal one, and all
are within two uncertainties of the module types."""

CARD_ZERO, METER_SLOPE = 0.01, 0.002
"""Standard uncertainties: card 0.2 % of 10 V, flow meter 0.4 %, over 2."""

METER_NOISE = 0.3 * METER_SLOPE
"""Of a sample, as share of the reading. Source: as in `sensors.Sensing`."""

LITRE_PER_HOUR = 1000.0 / 3600.0
"""cm3/s"""

CONVERTER = 10.0 / 4096.0
"""V; 12 bit over 10 V."""

STARTS = 1.0, 25.0
"""Lowest and highest first level, cm; the first reading is at most HIGHEST."""

HIGHEST = 8.0
"""V"""

ABOVE = 1.3
"""Range of a law over its value at the largest settled flow."""


@dataclass(frozen=True)
class Setup:
    """A plant without any effect, and its operation.

    Attributes
    ----------
    shown : the recorded input, without the noise of a meter
    difficulties : the difficulties in the sealed answer, sizes by law or sensor
    """

    plant: Plant
    profile: str
    time: Array
    shown: Array
    difficulties: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @cached_property
    def course(self) -> Course:
        """The course of the plant, which sets the limits of effects."""
        return integrate(self.plant, self.time, self.shown)

    @property
    def layout(self) -> Layout:
        """The plant's drawing."""
        return self.plant.layout

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
            plant.tanks[name]["outlet"]
            * math.sqrt(2.0 * GRAVITY * ((highest - s["zero"]) / s["gain"]))
            for name, s in plant.sensors.items()
        )
        levels = {name: _level_at(tank, flow) for name, tank in plant.tanks.items()}
        voltage = flow / plant.feed["gain"]
        can_be_set = 4.0 <= flow <= 40.0 and (layout.metered or 3.0 <= voltage <= 9.5)
        if can_be_set and all(8.0 <= level <= 30.0 for level in levels.values()):
            break
    kind = profile or DRAWN[int(random.integers(len(DRAWN)))]
    course = PROFILES[kind](stream(seed, f"input {layout.name}"), samples)
    time = layout.interval * np.arange(samples, dtype=np.float64)
    shown = np.round(course * flow / plant.feed["gain"], 3 if layout.metered else 4)
    # A flow meter has no law.
    ranges = levels if layout.metered else {**levels, layout.feed: voltage}
    plant, sizes = _hardened(plant, difficulties, seed, ranges)
    return Setup(plant, kind, time, shown, sizes)


def recorded_input(setup: Setup, seed: int) -> Array:
    """Return the input in the file: a meter adds noise, a voltage is as it was set."""
    if not setup.layout.metered:
        return setup.shown
    feed, shown = setup.plant.feed, setup.shown
    noise = stream(seed, "noise of the meter").standard_normal(shown.size)
    if feed["colour"]:
        noise = coloured(noise, feed["colour"])
    if feed["wander"] is not None:
        first = (feed["gain"] / LITRE_PER_HOUR - 1.0) / METER_SLOPE
        shown = shown * (1.0 - METER_SLOPE * (feed["wander"](first, shown.size) - first))
    return np.asarray(shown * (1.0 + METER_NOISE * noise))


def _drawn(layout: Layout, random: np.random.Generator) -> Plant:
    if layout.metered:
        feed = {"gain": LITRE_PER_HOUR * (1.0 + METER_SLOPE * _normal(random))}
    else:
        feed = {"gain": _draw("k", random), "zero": CARD_ZERO * _normal(random)}
    plant = Plant(layout, {}).with_(layout.feed, **feed)
    for name in layout.tanks:
        area, outlet, start = (_draw(number, random) for number in ("A", "a", "h0"))
        plant = plant.with_(name, area=area, outlet=outlet, start=start)
    for name in layout.measured:
        gain, zero = _draw("g", random), LEVEL_ZERO * _normal(random)
        noise = float(random.uniform(0.01, 0.03))
        plant = plant.with_(
            f"{name}{SENSOR}", gain=gain, zero=zero, noise=noise, converter=CONVERTER
        )
    for name, tank in plant.tanks.items():
        plant = _begun(plant, name, tank["start"])
    return plant


def _begun(plant: Plant, tank: str, level: float) -> Plant:
    """The plant with a level at the beginning that the tank's sensor, if any, can show."""
    most = [HIGHEST / s["gain"] for name, s in plant.sensors.items() if name == tank]
    return plant.with_(tank, start=min([level, *most]))


def _draw(name: str, random: np.random.Generator) -> float:
    """Draw a parameter from a normal distribution, within its bounds."""
    value, u, least = NOMINAL[name]
    while True:
        drawn = float(random.normal(value, u))
        if least <= drawn <= value + 2.0 * u:
            return drawn


def _normal(random: np.random.Generator) -> float:
    """Draw from the standard normal distribution, within the bounds of a sensor class."""
    while abs(drawn := float(random.standard_normal())) > 2.0:
        pass
    return drawn


def _level_at(tank: Numbers, flow: float) -> float:
    """Level at which a plain outlet passes a flow, cm."""
    return float((flow / tank["outlet"]) ** 2 / (2.0 * GRAVITY))


def _hardened(
    plant: Plant, names: Sequence[str], seed: int, ranges: Mapping[str, float]
) -> tuple[Plant, dict[str, dict[str, float]]]:
    """Draw the named difficulties, and their sizes; `ranges` has the largest settled level of each
    tank, cm, and the largest input of a pump, V, by its name."""
    sizes: dict[str, dict[str, float]] = {}
    layout = plant.layout
    if "form" in names:
        laws = ((law, ((0.0, ABOVE * most),)) for law, most in ranges.items())
        for law, form in form_errors(seed, laws).items():
            sizes.setdefault("form", {})[law] = form.rms
            plant = plant.with_(law, form=form)
    parts = {tank: f"{tank}{SENSOR}" for tank in layout.measured}
    parts |= {layout.feed: layout.feed} if layout.metered else {}
    if "coloured" in names:
        sizes["coloured"] = colours(seed, parts)
        for place, colour in sizes["coloured"].items():
            plant = plant.with_(parts[place], colour=colour)
    if "drift" in names:
        for place, drift in drifts(seed, parts).items():
            sizes.setdefault("drift", {})[place] = drift.extent
            plant = plant.with_(parts[place], wander=drift)
    for name in layout.tanks if "starts" in names else ():
        plant = _begun(plant, name, float(stream(seed, f"start {name}").uniform(*STARTS)))
        sizes.setdefault("starts", {})[name] = plant.tanks[name]["start"]
    return plant, sizes
