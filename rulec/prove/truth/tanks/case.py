"""A case: effects planted into a plant, and the recording of it with its answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..recording import Recording
from ..sealed import HIDES
from ..streams import FURTHER
from ..units import Array
from .balance import Course, integrate
from .build import CASCADED, Layout, Setup, build, recorded_input
from .effect import Scene
from .effects import Placed, possible_effects
from .plant import Plant
from .sensing import shown
from .size import Planted, Readings, change_of, is_inside, most, plant_all, plant_each, run

ATTEMPTS = 20
"""Plants drawn until effects show as they should."""

CLEAR = 0.1
"""V; what is left of effects that hide each other."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A recording, and what was planted.

    `plant` has all effects, each as `planted` has it alone; `scene` is the plant without any.
    `drawn` is the seed of the attempt that was taken.
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
    """A case from its seed and the ids of its effects; the same arguments give the same bytes.

    Plants are drawn until every effect shows, and with `hiding`, until they hide each other.
    `strength`, V, is what each effect changes alone, root mean square, instead of what is drawn.
    `rarely` is the largest size of an effect, for those whose size is the share of samples where
    they act. `difficulties` are what makes the case harder, of `sealed.DIFFICULTIES`.
    Raises ValueError for an unknown effect, or where that never happens.
    """
    known = possible_effects(layout)
    for effect in effects:
        if effect not in known:
            raise ValueError(f"no effect '{effect}'; known: {', '.join(known)}")
    wanted = [_at_most(known[e], rarely) for e in effects]
    clear = CLEAR if strength is None else 0.0
    for attempt in range(ATTEMPTS):
        drawn = seed + attempt * FURTHER
        setup = build(layout, drawn, samples, profile, difficulties)
        scene = Scene(setup, integrate(setup.plant, setup.time, setup.shown))
        planted = plant_each(scene, wanted, drawn, strength)
        if planted is None:
            continue
        plant = plant_all(scene, planted, drawn)
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


def _at_most(placed: Placed, size: float) -> Placed:
    """The effect with another largest size."""
    effect = placed.effect
    return replace(placed, effect=replace(effect, high=min(effect.high, size)))


def _recorded(setup: Setup, plant: Plant, course: Course, seed: int) -> Recording:
    """Columns as the plant's file of columns names them."""
    readings: Readings = shown(plant, course, seed)
    layout = setup.layout
    columns = {"time [s]": setup.time, layout.input_column: recorded_input(setup, seed)}
    columns |= {layout.columns[tank]: values for tank, values in readings.items()}
    return Recording(columns, _truth(setup, course))


def _truth(setup: Setup, course: Course) -> dict[str, Array]:
    """Levels and flows as they were."""
    columns = {"time [s]": course.time, f"{setup.layout.feed} [cm3/s]": course.fed}
    for i, tank in enumerate(setup.layout.tanks):
        columns[f"{tank}.h [cm]"] = course.levels[:, i]
        columns[f"{tank}.outflow [cm3/s]"] = course.left[:, i]
    return columns
