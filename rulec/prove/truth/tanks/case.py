"""A case: effects planted into a plant, each of the size that changes the readings as planned, and
the recording.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..recording import Recording
from ..sealed import HIDES
from ..streams import FURTHER, stream
from ..units import Array
from .balance import Course, integrate
from .build import CASCADED, Layout, Setup, build, recorded_input
from .effect import Built, Here, Placed, Scene, made, possible_effects
from .plant import Plant
from .sensing import shown

LEAST, MOST = 0.3, 1.0
"""V; range of the target: RMS change by the effect alone of the reading that shows it most."""

ACCEPTED = 0.15, 1.5
"""V; accepted change if the range of sizes ends before the target."""

VISIBLE = 0.02, 2.5
"""V; accepted change if a given strength cannot be reached."""

FAINT = 20.0
"""Factor by which the least size is reduced if a strength is given."""

NEAR = 1.2
"""Factor to the target within which the search ends."""

TRIES = 8

LOWEST, HIGHEST = -0.2, 9.9
"""V; range of a sensor, which readings must not leave."""

Readings = Mapping[str, Array]
"""Voltages by tank."""


@dataclass(frozen=True)
class Planted:
    """An effect with its size, and its change of the readings alone."""

    placed: Placed
    size: float
    built: Built
    change: Readings


def plant_each(
    scene: Scene, wanted: Sequence[Placed], seed: int, strength: float | None
) -> list[Planted] | None:
    """Size each effect alone for a drawn change; None if the plant cannot show one of them.

    `strength`, V, replaces the drawn change; if the plant cannot show it, the nearest is taken.
    """
    drawn = float(stream(seed, "aim").uniform(NEAR * LEAST, MOST / NEAR))
    plain = shown(scene.setup.plant, scene.course)
    found = []
    for placed in wanted:
        if strength is None:
            aim, accepted = drawn * placed.effect.scale, ACCEPTED
        else:
            placed = replace(placed, effect=replace(placed.effect, low=placed.effect.low / FAINT))
            aim, accepted = strength, VISIBLE
        one = _sought(scene, plain, placed, aim, accepted, seed)
        if one is None:
            return None
        found.append(one)
    return found


def run(scene: Scene, plant: Plant) -> Course:
    """Simulate a plant; if only sensors err, the course is that of the scene."""
    plain = scene.setup.plant
    same = (plant.feed, plant.tanks) == (plain.feed, plain.tanks)
    if same and not any(s.lag or s.dead_time for s in plant.sensors):
        return scene.course
    return integrate(plant, scene.setup.time, scene.setup.shown)


def change_of(readings: Readings, plain: Readings) -> dict[str, Array]:
    """Return the change of the readings by tank."""
    return {tank: readings[tank] - plain[tank] for tank in plain}


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def most(change: Readings) -> float:
    """Return the RMS change of the reading that changes most, V."""
    return max(rms(values) for values in change.values())


def is_inside(plant: Plant, course: Course) -> bool:
    """Return whether all readings are within the range of their sensors."""
    values = shown(plant, course).values()
    return all(v.min() >= LOWEST and v.max() <= HIGHEST for v in values)


def _sought(
    scene: Scene,
    plain: Readings,
    placed: Placed,
    aim: float,
    accepted: tuple[float, float],
    seed: int,
) -> Planted | None:
    """Search the size with the target change: within bounds, by the ratio to the target."""
    low, high = placed.effect.low, placed.effect.high
    largest, size, best, least = high, math.sqrt(low * high), None, math.inf
    for _ in range(TRIES):
        built = make(scene, scene.setup.plant, placed, size, seed)
        course = run(scene, built.plant)
        change = change_of(shown(built.plant, course), plain)
        reached = max(most(change), 1e-3 * aim)
        off = abs(math.log(reached / aim))
        inside = is_inside(built.plant, course)
        low, high = (size, high) if inside and reached < aim else (low, size)
        if inside and off < least:
            best, least = Planted(placed, size, built, change), off
        if least < math.log(NEAR) or high / low < 1.02:
            break
        guess = size * aim / reached
        if low * 1.01 < guess < high / 1.01:
            size = guess
        else:
            size = high if guess >= high == largest else math.sqrt(low * high)
    if best is None or not accepted[0] <= most(best.change) <= accepted[1]:
        return None
    return best


def make(scene: Scene, plant: Plant, placed: Placed, size: float, seed: int) -> Built:
    """Make an effect of some size; its shape is the same at every size."""
    return made(placed.effect, Here(scene, plant, placed.place, size, stream(seed, placed.id)))


ATTEMPTS = 20
"""Most plants that are drawn until effects show as planned."""

CLEAR = 0.1
"""V; least change by all effects together."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A recording, and the planted effects.

    `plant` has all effects, `planted` each of them alone; `scene` is the plant without any. `drawn`
    is the seed of the successful attempt.
    """

    name: str
    seed: int
    drawn: int
    scene: Scene
    plant: Plant
    planted: tuple[Planted, ...]
    recording: Recording

    @property
    def setup(self) -> Setup:
        """The plant without effects, and its input."""
        return self.scene.setup


def case(
    seed: int,
    effects: Sequence[str] = (),
    samples: int = 1024,
    layout: Layout = CASCADED,
    *,
    name: str = "",
    hiding: bool = False,
    strength: float | None = None,
    profile: str = "",
    rarely: float = math.inf,
    difficulties: Sequence[str] = (),
) -> Case:
    """Make a case from its seed and the ids of its effects; same arguments give same bytes.

    Plants are drawn until every effect shows, and with `hiding`, until they hide each other.
    `strength`, V, replaces the drawn RMS change by each effect alone. `rarely` is the largest size
    of an effect, for those whose size is the share of samples in which they act. `difficulties` are
    of `sealed.DIFFICULTIES`. Raises ValueError for an unknown effect, or if no plant shows them.
    """
    known = possible_effects(layout)
    for effect in effects:
        if effect not in known:
            raise ValueError(f"no effect '{effect}'; known: {', '.join(known)}")
    placed = [known[e] for e in effects]
    wanted = [replace(p, effect=replace(p.effect, high=min(p.effect.high, rarely))) for p in placed]
    clear = CLEAR if strength is None else 0.0
    for attempt in range(ATTEMPTS):
        drawn = seed + attempt * FURTHER
        setup = build(layout, drawn, samples, profile, difficulties)
        scene = Scene(setup, integrate(setup.plant, setup.time, setup.shown))
        planted = plant_each(scene, wanted, drawn, strength)
        if planted is None:
            continue
        plant = setup.plant
        for one in planted:  # each of the size it has alone
            plant = make(scene, plant, one.placed, one.size, drawn).plant
        course = run(scene, plant)
        change = change_of(shown(plant, course), shown(setup.plant, scene.course))
        share = None
        if len(planted) > 1:
            share = most(change) / math.hypot(*(most(one.change) for one in planted))
        if not is_inside(plant, course) or (planted and most(change) < clear):
            continue
        if hiding and share is not None and share > HIDES:
            continue
        return Case(
            name=name,
            seed=seed,
            drawn=drawn,
            scene=scene,
            plant=plant,
            planted=tuple(planted),
            recording=_recorded(setup, plant, course, drawn),
        )
    raise ValueError(f"no plant of {ATTEMPTS} shows {' and '.join(effects)} as it should")


def _recorded(setup: Setup, plant: Plant, course: Course, seed: int) -> Recording:
    layout = setup.layout
    readings = {"time [s]": setup.time, layout.input_column: recorded_input(setup, seed)}
    for tank, values in shown(plant, course, seed).items():
        readings[layout.columns[tank]] = values
    truth = {"time [s]": course.time, f"{layout.feed} [cm3/s]": course.fed}
    for i, tank in enumerate(layout.tanks):
        truth[f"{tank}.h [cm]"] = course.levels[:, i]
        truth[f"{tank}.outflow [cm3/s]"] = course.left[:, i]
    return Recording(readings, truth)
