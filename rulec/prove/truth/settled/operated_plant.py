"""A true plant and its operation, before anything is planted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..sensors import Sensing, read
from ..smooth import wobble
from ..streams import stream
from ..transients import SPEED_TIME, approach
from ..units import BAR, LITRE_PER_HOUR, Array
from . import drive
from .difficulty import NONE, Difficulty, difficulty
from .pumps import Values
from .rig import Rig
from .solve import Operated, solve
from .term import Change, shown_by, written_by

SENSING = Sensing(law="truncated")
"""Errors of sensors stay inside the bounds of their class."""

DAY = 86400.0

FLOW = 1000.0 * LITRE_PER_HOUR
"""Largest flow of a metered pump, proportional to its speed."""

SUCTION = 0.15 * BAR, -0.75 * BAR
"""Gauge pressure before a metered pump, with the suction valve open and nearly closed."""

LOAD = 120.0 * BAR, 170.0 * BAR
"""Range of the pressure that a load sets."""

ACROSS, BEHIND = (0.3 * BAR, 9.0 * BAR), (0.1 * BAR, 3.0 * BAR)
"""Range of the pressure across a valve, and of the gauge pressure behind it."""

TRAVEL = 0.08, 0.98
"""Range of the travel of a valve."""

USED = 0.08, 0.95
"""Part of the range of a speed or load that operation uses."""

OPENED = 0.1, 1.0
"""Range of the flow through the valve behind a pump, as share of the largest one."""


@dataclass(frozen=True)
class Scene:
    """The course of a plant from which the plain model leaves nothing out.

    Attributes
    ----------
    values : true parameters, SI
    first : first sample of the recording; earlier ones are of a run for calibration
    time : samples since the recording began, shape (n,), never negative
    given : true inputs, SI, by signal
    temperature, level : of each pump module, K and m
    suction : gauge pressure before each metered pump or valve, Pa
    density : of the liquid in each valve, kg/m3
    running : bool; while the plant stands, all readings but those of tanks are zero
    plain : true values of all signals, SI
    hard : its difficulties; the form errors are in `plain`
    pace : sampling interval, s
    correlated : whether temperatures follow the load
    further : number of samples at the end that belong to a further recording
    """

    rig: Rig
    profile: str
    seed: int
    values: Values
    first: int
    time: Array
    given: Mapping[str, Array]
    temperature: Mapping[str, Array]
    level: Mapping[str, Array]
    suction: Mapping[str, Array]
    density: Mapping[str, Array]
    running: np.ndarray
    plain: Mapping[str, Array]
    hard: Difficulty = NONE
    pace: float = 1.0
    correlated: bool = False
    further: int = 0

    @property
    def days(self) -> float:
        """Length of the recording."""
        return self.length * self.pace / DAY

    @property
    def known(self) -> slice:
        """Samples that shape planted effects: all but those of a further recording."""
        return slice(self.time.size - self.further)

    @property
    def length(self) -> float:
        """Length of the recording in samples, less one."""
        return float(self.time[self.known][-1])

    @property
    def clock(self) -> Array:
        """Time of all samples, also those before the recording, s."""
        return np.arange(self.time.size, dtype=np.float64) * self.pace

    def truly(self, terms: Sequence[Change] = (), values: Values | None = None) -> dict[str, Array]:
        """Return the true values of all signals with some terms, SI.

        Raises Stalled if there is no operating point.
        """
        values = values or self.values
        laws = (*self.hard.terms(self.rig, values), *terms)
        found = solve(Operated(self.rig, values, self.given, laws), self.plain)
        around = ambient(self.rig, self.temperature, self.level, self.suction, self.density)
        return {**around, **self.given, **found}

    def shown(self, truth: Mapping[str, Array], terms: Sequence[Change] = ()) -> dict[str, Array]:
        """Return the columns of the file for sensors without errors of their class, SI."""
        return written_by(terms, self._sensed(truth, terms))

    def _sensed(self, truth: Mapping[str, Array], terms: Sequence[Change]) -> dict[str, Array]:
        return {
            name: shown_by(terms, name, truth[name]) for name in self.rig.sensors if name in truth
        }

    def recorded(
        self, truth: Mapping[str, Array], terms: Sequence[Change] = ()
    ) -> dict[str, Array]:
        """Return the columns of the recording by header, in the units of the sensors."""
        read = {}
        for place, value in self._sensed(truth, terms).items():
            if not place.endswith((".T", ".l")):
                value = np.where(self.running, value, 0.0)
            read[place] = self.read(place, value, SENSING)
        columns = {"time [s]": self.clock}
        for place, value in written_by(terms, read).items():
            columns[f"{place} [{self.rig.sensors[place].unit}]"] = value
        return columns

    def read(self, place: str, value: Array, sensing: Sensing) -> Array:
        """Return the reading of a sensor with the errors of its class, in its unit."""
        colour, drift = self.hard.colour.get(place, 0.0), self.hard.drift.get(place)
        return read(self.rig.sensors[place], place, value, sensing, self.seed, colour, drift)


def scene(
    rig: Rig,
    seed: int,
    samples: int,
    profile: str,
    correlated: bool = False,
    before: int = 0,
    difficulties: Sequence[str] = (),
    pace: float = 1.0,
) -> Scene:
    """Draw true parameters and the operation, `before` samples longer than the recording.

    Raises Stalled if the plant cannot be run so.
    """
    random = stream(seed, "course")
    share = drive.shares(random, list(rig.pumps), profile, samples, before)
    make = drive.PROFILES[profile]
    load = ACROSS if rig.by_travel else LOAD
    hard = difficulty(rig, difficulties, seed, load)
    samples += before
    seconds = np.arange(samples, dtype=np.float64)
    given = {}
    for m in rig.pumps:
        low, high = load if rig.by_load else rig.kind(m).speeds
        setting = low + (high - low) * (USED[0] + (USED[1] - USED[0]) * share[m])
        place = f"{m}.{'dp' if rig.by_load else 'n'}"
        given[place] = approach(seconds, setting, SPEED_TIME)
        if place in hard.wobble:
            course = wobble(stream(seed, f"wobble {place}"), samples)
            given[place] = given[place] + (high - low) * hard.wobble[place] * course
        if rig.by_travel:
            travel = TRAVEL[0] + (TRAVEL[1] - TRAVEL[0]) * make(random, samples)
            given[f"{m}.x"] = approach(seconds, travel, SPEED_TIME)
        if rig.by_meter:
            opened = OPENED[0] + (OPENED[1] - OPENED[0]) * make(random, samples)
            reached, usual = approach(seconds, opened, SPEED_TIME), rig.numbers[f"{m}.n0"][0]
            given[f"{m}.Q"] = FLOW * reached * given[f"{m}.n"] / usual
    temperatures = {
        m: drive.by_load(random, share[m]) if correlated else drive.temperature(random, samples)
        for m in rig.pumps
    }
    if rig.by_temperature:
        given |= {f"{m}.T": values for m, values in temperatures.items()}
    levels = {m: drive.level(random, samples) for m in rig.pumps}
    suctions = {m: _throttled(random, seconds, make) for m in rig.pumps if rig.by_meter}
    if rig.by_travel:
        suctions = {m: given[f"{m}.dp"] + _behind(random, seconds, make) for m in rig.pumps}
    densities = {m: drive.density(random, samples) for m in rig.pumps if rig.by_travel}
    running = np.ones(samples, dtype=bool)
    if profile == "start-stop":
        running = drive.stops(random, samples) > 0
        running[:before] = True
    values = drawn(rig, stream(seed, "parameters"))
    found = solve(Operated(rig, values, given, hard.terms(rig, values)))
    around = ambient(rig, temperatures, levels, suctions, densities)
    time = np.maximum(seconds - before, 0.0)
    return Scene(
        rig,
        profile,
        seed,
        values,
        before,
        time,
        given,
        temperatures,
        levels,
        suctions,
        densities,
        running,
        {**around, **given, **found},
        hard,
        pace,
        correlated,
    )


def may_be_set(rig: Rig) -> dict[str, tuple[float, float]]:
    """Return the limits of inputs, SI: the range that operation uses. Nobody sets temperatures."""
    found = {}
    for m in rig.pumps:
        low, high = (ACROSS if rig.by_travel else LOAD) if rig.by_load else rig.kind(m).speeds
        ends = low + (high - low) * USED[0], low + (high - low) * USED[1]
        found[f"{m}.{'dp' if rig.by_load else 'n'}"] = ends
        if rig.by_travel:
            found[f"{m}.x"] = TRAVEL
        if rig.by_meter:
            usual = rig.numbers[f"{m}.n0"][0]
            found[f"{m}.Q"] = FLOW * OPENED[0] * ends[0] / usual, FLOW * OPENED[1] * ends[1] / usual
    return found


def drawn(rig: Rig, random: np.random.Generator) -> dict[str, float]:
    """Draw true parameters within two uncertainties of the values in the module types."""
    found = {}
    for name, (value, u) in rig.numbers.items():
        found[name] = value + u * float(np.clip(random.standard_normal(), -2.0, 2.0))
        # The slip of an oil set must not be negative; its stated value is only a first guess.
        if value > 0 and u > 0.5 * value:
            found[name] = value * float(random.uniform(0.4, 1.6))
    return found


def _throttled(random: np.random.Generator, seconds: Array, make: Callable[..., Array]) -> Array:
    """Gauge pressure behind a suction valve that is closed in steps."""
    opened, shut = SUCTION
    return opened + (shut - opened) * approach(seconds, make(random, seconds.size), SPEED_TIME) ** 2


def _behind(random: np.random.Generator, seconds: Array, make: Callable[..., Array]) -> Array:
    """Gauge pressure behind a valve."""
    low, high = BEHIND
    return low + (high - low) * approach(seconds, make(random, seconds.size), SPEED_TIME)


def ambient(
    rig: Rig,
    temperature: Mapping[str, Array],
    level: Mapping[str, Array],
    suction: Mapping[str, Array],
    density: Mapping[str, Array],
) -> dict[str, Array]:
    """Return the true values of signals that the plant does not cause, SI."""
    found = {f"{m}.T": v for m, v in temperature.items() if f"{m}.T" in rig.sensors}
    found |= {f"{m}.{rig.gauge}": values for m, values in suction.items()}
    found |= {f"{m}.rho": values for m, values in density.items()}
    if not (rig.by_load or rig.by_meter):
        found |= {f"{m}.l": values for m, values in level.items()}
    return found
