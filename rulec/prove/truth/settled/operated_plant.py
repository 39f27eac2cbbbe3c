"""A true plant and its operation, before anything is planted."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..sensors import Sensing, read
from ..smooth import wobble
from ..streams import stream
from ..units import LITRE_PER_HOUR, Array
from . import drive
from .difficulty import Difficulty, difficulty
from .rig import UNITS, Rig, Values
from .solve import Operated, Term, shown_by, solve, written_by

SENSING = Sensing(law="truncated")
"""Errors of sensors stay inside the bounds of their class."""

DAY = 86400.0

FLOW = 1000.0 * LITRE_PER_HOUR
"""Largest flow of a metered pump, proportional to its speed."""

USED = 0.08, 0.95
"""Part of the range of the main setting, a speed or load, that operation uses."""

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
    def shaping(self) -> slice:
        """Samples that shape planted effects: all but those of a further recording."""
        return slice(self.time.size - self.further)

    @property
    def length(self) -> float:
        """Length of the recording in samples, less one."""
        return float(self.time[self.shaping][-1])

    @property
    def clock(self) -> Array:
        """Time of all samples, also those before the recording, s."""
        return np.arange(self.time.size, dtype=np.float64) * self.pace

    @property
    def warmth(self) -> Array:
        """Temperature of the liquid at the first pump, K."""
        return self.plain[f"{next(iter(self.rig.pumps))}.T"]

    def truly(self, terms: Sequence[Term] = (), values: Values | None = None) -> dict[str, Array]:
        """Return the true values of all signals with some terms, SI.

        Raises Stalled if there is no operating point.
        """
        values = values or self.values
        laws = (*self.hard.terms(self.rig, values), *terms)
        found = solve(Operated(self.rig, values, self.given, laws), self.plain)
        return {**self.around, **self.given, **found}

    def shown(self, truth: Mapping[str, Array], terms: Sequence[Term] = ()) -> dict[str, Array]:
        """Return the columns of the file for sensors without errors of their class, SI."""
        return written_by(terms, self._sensed(truth, terms))

    def _sensed(self, truth: Mapping[str, Array], terms: Sequence[Term]) -> dict[str, Array]:
        return {n: shown_by(terms, n, truth[n]) for n in self.rig.sensors if n in truth}

    def recorded(self, truth: Mapping[str, Array], terms: Sequence[Term] = ()) -> dict[str, Array]:
        """Return the columns of the recording by header, in the units of the sensors."""
        read = {}
        for place, value in self._sensed(truth, terms).items():
            running = self.running | place.endswith((".T", ".l"))
            read[place] = self.read(place, np.where(running, value, 0.0), SENSING)
        columns = {
            f"{p} [{self.rig.sensors[p].unit}]": v for p, v in written_by(terms, read).items()
        }
        return {"time [s]": self.clock, **columns}

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
    hard = difficulty(rig, difficulties, seed)
    samples += before
    seconds = np.arange(samples, dtype=np.float64)

    def reached(setting: Array) -> Array:
        return drive.approach(seconds, setting, drive.SPEED_TIME)

    def setting(ends: tuple[float, float] = (0.0, 1.0)) -> Array:
        return reached(_part(ends, drive.course(random, profile, samples)))

    given: dict[str, Array] = {}
    around: dict[str, Array] = {}
    for m in rig.pumps:
        (main, ends), *others = rig.kind(m).settings.items()
        place = f"{m}.{main}"
        given[place] = reached(_part(ends, _part(USED, share[m])))
        if place in hard.wobble:
            course = wobble(stream(seed, f"wobble {place}"), samples)
            given[place] = given[place] + (ends[1] - ends[0]) * hard.wobble[place] * course
        given |= {f"{m}.{name}": setting(ends) for name, ends in others}
        if rig.by_meter:
            most = FLOW * setting(OPENED)
            given[f"{m}.Q"] = most * given[f"{m}.n"] / rig.numbers[f"{m}.n0"][0]
    for m in rig.pumps:
        warm = drive.by_load(random, share[m]) if correlated else drive.temperature(random, samples)
        (given if f"{m}.T" in rig.inputs else around)[f"{m}.T"] = warm
    # Every pump has a tank, whether its level is recorded or not.
    around |= {f"{m}.l": drive.level(random, samples) for m in rig.pumps}
    drawing = {"setting": setting, "density": functools.partial(drive.density, random, samples)}
    for m, name in ((m, name) for name in rig.around for m in rig.pumps):
        own = {"dp": given.get(f"{m}.dp"), **drawing}
        around[f"{m}.{name}"] = UNITS.with_(**own).of(rig.around[name])
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


def _part(ends: tuple[float, float], share: Array) -> Array:
    """Values at shares of a range."""
    return np.asarray(ends[0] + (ends[1] - ends[0]) * share)


def may_be_set(rig: Rig) -> dict[str, tuple[float, float]]:
    """Return the limits of inputs, SI: the range that operation uses. Nobody sets temperatures."""
    found: dict[str, tuple[float, float]] = {}
    for m in rig.pumps:
        (main, ends), *others = rig.kind(m).settings.items()
        low, high = _part(ends, np.array(USED)).tolist()
        found |= {f"{m}.{main}": (low, high)} | {f"{m}.{name}": ends for name, ends in others}
        if rig.by_meter:
            usual = rig.numbers[f"{m}.n0"][0]
            found[f"{m}.Q"] = FLOW * OPENED[0] * low / usual, FLOW * OPENED[1] * high / usual
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
