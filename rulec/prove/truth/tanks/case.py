"""A case: effects planted into a plant, and its recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..recording import Recording
from ..sealed import HIDES
from ..streams import FURTHER
from .balance import Course, integrate
from .build import CASCADED, Layout, Setup, build, recorded_input
from .effect import Scene
from .effect_size import Planted, change_of, is_inside, most, plant_all, plant_each, run
from .effects import possible_effects
from .plant import Plant
from .sensing import shown

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
