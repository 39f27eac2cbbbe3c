"""Candidate explanations of a mismatch: effects, faults and sensor errors at a place of a plant.

Candidates are data; `model_builder.py` turns a module with some of them built in into a plan.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.effect import Shape

TIME = "time"
"""Plan input: seconds since the beginning of the recording, for effects that change with time."""

MEDIAN = (0.5,)
"""The quantile of unknowns that state none."""


@dataclass(frozen=True, kw_only=True)
class Unknown(Shape):
    """A parameter that a candidate introduces; numbers in SI, `driver` is the id of a signal.

    `id` is its input in the plan. A `fixed` one takes a statistic of the readings of `driver`: the
    median, the quantile in `quantiles`, or with two quantiles half the distance between them (the
    spread). It is shown in `unit`: SI = shown * factor + offset.
    """

    id: str
    unit: str
    factor: float
    offset: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One explanation at one place.

    `sort` is ``physics``, ``ageing``, ``fault``, ``sensor``, ``free`` (no physics, as a search
    finds it) or ``curve`` (no physics, as a module type holds it). `id` is unique in the plant, as
    ``A.slip-temperature@Q_law``; a fault has its id in the ruleset. `place` is the definition,
    observer or signal that it changes; `observers` lists the ids of all observers that it affects.
    `drivers` maps the names in its law to ids of signals of the plant (or ``time``); `equation`
    shows the repaired relation. `text` has slots for parameters only.
    """

    id: str
    sort: str
    name: str
    title: str
    module: str
    place: str
    observers: tuple[str, ...]
    unknowns: tuple[Unknown, ...]
    drivers: Mapping[str, str]
    equation: str
    text: str
    action: str
    source: str
    members: tuple[str, ...] = ()

    @property
    def modules(self) -> tuple[str, ...]:
        """All modules that it acts on."""
        return self.members or (self.module,)

    @property
    def follows_time(self) -> bool:
        """Does it depend on time, so that it needs a clock?"""
        return TIME in self.drivers.values() or any(u.driver == TIME for u in self.unknowns)

    @property
    def onset(self) -> Unknown | None:
        """The unknown onset, if there is one."""
        return next((u for u in self.unknowns if u.driver == TIME and not u.fixed), None)


@dataclass(frozen=True, kw_only=True)
class Missing:
    """An effect that would fit a place if its driver were recorded.

    `quantity` is what would have to be measured, `title` and `sensor` are the words for the user.
    """

    name: str
    title: str
    module: str
    place: str
    quantity: str
    sensor: str


@dataclass(frozen=True, kw_only=True)
class DisturbanceLocation:
    """A disturbance location: a place that `unknown` shifts, in its own unit.

    `kind` is ``definition``, ``observer``, ``signal``, ``balance`` or ``reading``. `unit` is the
    unit in which its values are shown, SI = shown * factor. `accuracy` of a law is a share of its
    value.
    """

    id: str
    kind: str
    module: str
    place: str
    title: str
    unit: str
    factor: float
    observers: tuple[str, ...]
    unknown: str
    accuracy: float = 0.0

    def may_follow(self, driver: str) -> bool:
        """Whether a module type may hold a curve over `driver` here: its own, in no parameter, and
        in no sensor, which is to be mended."""
        own = driver.startswith(f"{self.module}.")
        return own and self.kind not in ("parameter", "signal")


@dataclass(frozen=True, kw_only=True)
class BaseParameters:
    """Parameters of the plain plant that recalibration may change, SI.

    `ids` are plan inputs such as ``A.k2``; all other parameters are `constants`. `covariance`,
    shape (parameters, parameters), is from the calibration. `sheet` has value and standard
    uncertainty by the data sheet. Values lie between `lowest` and `highest`; `positive` flags those
    that are positive by their meaning; all three have shape (parameters,).
    """

    ids: tuple[str, ...]
    units: tuple[str, ...]
    factors: Array
    values: Array
    positive: np.ndarray
    lowest: Array
    highest: Array
    covariance: Array
    constants: Mapping[str, float]
    sheet: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class CurveTerm:
    """What is added to a law, over a reading or a state of its own module, without physics.

    `points` are values of the driver and of the term, SI; it is straight between them, and level
    beyond the first and the last. `place` is the id of its place.
    """

    place: str
    driver: str
    points: tuple[tuple[float, float], ...]

    @property
    def id(self) -> str:
        """Id of the candidate that builds it in."""
        return f"{self.place}[{self.driver}, curve]"


@dataclass(frozen=True)
class Changed:
    """A recalibrated parameter of the plain model (SI), for the repaired model."""

    id: str
    value: float
    u: float


@dataclass(frozen=True)
class Repair:
    """Values of a plant that can be written, SI.

    `joined` are ids of its candidates. `parameters`, those of the candidates behind base
    parameters, have a joint `covariance`, shape (parameters, parameters). `fixed` are references of
    joined candidates, `misfit` the remaining error per observer, m3/s, `ranges` the readings per
    signal at which its relations were tested, `curves` the joined terms without physics. It was
    found in a `recording` of this name.
    """

    joined: tuple[str, ...]
    parameters: tuple[Changed, ...]
    covariance: Array
    fixed: Mapping[str, float]
    misfit: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]
    curves: tuple[CurveTerm, ...] = ()
    recording: str = ""

    @property
    def values(self) -> dict[str, float]:
        """All values by id: parameters, and references of candidates."""
        return {**self.fixed, **{p.id: p.value for p in self.parameters}}


class Unwritable(Exception):
    """A repair cannot be written as a plant; the message says why."""
