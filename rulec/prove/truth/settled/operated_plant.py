"""A true plant and its operation, before anything is planted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..sensors import Sensing, read
from ..smooth import wobble
from ..streams import stream
from ..units import BAR, LITRE_PER_HOUR, Array
from . import drive
from .difficulty import Difficulty, difficulty
from .rig import Rig, Values
from .solve import Change, Operated, shown_by, solve, written_by

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
    around : signals that the plant neither gets nor causes, SI: temperatures, levels, gauge
        pressures before a metered pump or valve, densities
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
    around: Mapping[str, Array]
    running: np.ndarray
    plain: Mapping[str, Array]
    hard: Difficulty
    pace: float
    correlated: bool
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

    @property
    def warmth(self) -> Array:
        """Temperature of the liquid at the first pump, K."""
        return self.plain[f"{next(iter(self.rig.pumps))}.T"]

    def truly(self, terms: Sequence[Change] = (), values: Values | None = None) -> dict[str, Array]:
        """Return the true values of all signals with some terms, SI.

        Raises Stalled if there is no operating point.
        """
        values = values or self.values
        laws = (*self.hard.terms(self.rig, values), *terms)
        found = solve(Operated(self.rig, values, self.given, laws), self.plain)
        return {**self.around, **self.given, **found}

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
    hard = difficulty(rig, difficulties, seed, ACROSS if rig.by_travel else LOAD)
    samples += before
    seconds = np.arange(samples, dtype=np.float64)

    def setting() -> Array:
        return drive.course(random, profile, samples)

    def reached(setting: Array) -> Array:
        return drive.approach(seconds, setting, drive.SPEED_TIME)

    given: dict[str, Array] = {}
    around: dict[str, Array] = {}
    for m in rig.pumps:
        place, low, high = _main_setting(rig, m)
        given[place] = reached(low + (high - low) * (USED[0] + (USED[1] - USED[0]) * share[m]))
        if place in hard.wobble:
            course = wobble(stream(seed, f"wobble {place}"), samples)
            given[place] = given[place] + (high - low) * hard.wobble[place] * course
        if rig.by_travel:
            given[f"{m}.x"] = reached(TRAVEL[0] + (TRAVEL[1] - TRAVEL[0]) * setting())
        if rig.by_meter:
            opened = reached(OPENED[0] + (OPENED[1] - OPENED[0]) * setting())
            given[f"{m}.Q"] = FLOW * opened * given[f"{m}.n"] / rig.numbers[f"{m}.n0"][0]
    for m in rig.pumps:
        warm = drive.by_load(random, share[m]) if correlated else drive.temperature(random, samples)
        (given if f"{m}.T" in rig.inputs else around)[f"{m}.T"] = warm
    around |= {f"{m}.l": drive.level(random, samples) for m in rig.pumps}
    for m in rig.pumps if rig.by_meter else ():
        around[f"{m}.p_s"] = SUCTION[0] + (SUCTION[1] - SUCTION[0]) * reached(setting()) ** 2
    for m in rig.pumps if rig.by_travel else ():
        behind = BEHIND[0] + (BEHIND[1] - BEHIND[0]) * reached(setting())
        around[f"{m}.p_1"] = given[f"{m}.dp"] + behind
    around |= {f"{m}.rho": drive.density(random, samples) for m in rig.pumps if rig.by_travel}
    around = {place: values for place, values in around.items() if place in rig.sensors}
    running = np.ones(samples, dtype=bool)
    if profile == "start-stop":
        running = drive.stops(random, samples) > 0
        running[:before] = True
    values = drawn(rig, stream(seed, "parameters"))
    found = solve(Operated(rig, values, given, hard.terms(rig, values)))
    return Scene(
        rig,
        profile,
        seed,
        values,
        first=before,
        time=np.maximum(seconds - before, 0.0),
        given=given,
        around=around,
        running=running,
        plain={**around, **given, **found},
        hard=hard,
        pace=pace,
        correlated=correlated,
    )


def _main_setting(rig: Rig, module: str) -> tuple[str, float, float]:
    """The input that is set by shares of its range, and that range, SI."""
    if rig.by_load:
        return f"{module}.dp", *(ACROSS if rig.by_travel else LOAD)
    return f"{module}.n", *rig.kind(module).speeds


def may_be_set(rig: Rig) -> dict[str, tuple[float, float]]:
    """Return the limits of inputs, SI: the range that operation uses. Nobody sets temperatures."""
    found = {}
    for m in rig.pumps:
        place, low, high = _main_setting(rig, m)
        ends = low + (high - low) * USED[0], low + (high - low) * USED[1]
        found[place] = ends
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
