"""Candidate explanations of a mismatch: effects, faults and sensor errors at a place of a plant.

Candidates are data; `model_builder.py` turns a module with some of them built in into a plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.shape import Shape

TIME = "time"
"""Plan input: seconds since the beginning of the recording, for effects that change with time."""

MEDIAN = (0.5,)
"""Quantile at which what has none stays."""


@dataclass(frozen=True, kw_only=True)
class Unknown(Shape):
    """A parameter that a candidate brings in; numbers in SI, `driver` is the id of a signal.

    `id` is its input in the plan. One that is `fixed` stays at the median reading of `driver`, at
    the one quantile that `quantiles` has, or where there are two, at half the distance between the
    readings there (their spread). It is shown in `unit`: SI = shown * factor + offset.
    """

    id: str
    unit: str
    factor: float
    offset: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One explanation at one place.

    `sort` is ``physics``, ``ageing``, ``fault``, ``sensor`` or ``free``. `id` is unique in the
    plant, as ``A.slip-temperature@Q_law``; that of a fault is its id in the ruleset. `place` is the
    definition, observer or signal that it changes; `observers` lists the ids of all observers that
    it reaches. `drivers` maps the names in its law to ids of signals of the plant (or ``time``);
    `equation` shows the repaired relation. `text` has slots for parameters, all others are filled.
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
        """All modules where it acts."""
        return self.members or (self.module,)

    @property
    def follows_time(self) -> bool:
        """Does it depend on time? Then it needs a clock."""
        return TIME in self.drivers.values() or any(u.driver == TIME for u in self.unknowns)

    @property
    def onset(self) -> Unknown | None:
        """The unknown onset, where the candidate has one."""
        return next((u for u in self.unknowns if u.driver == TIME and not u.fixed), None)


@dataclass(frozen=True, kw_only=True)
class Missing:
    """An effect that would join a place, were its driver recorded.

    `quantity` is what would have to be measured, `title` and `sensor` are the words for the user.
    """

    name: str
    title: str
    module: str
    place: str
    quantity: str
    sensor: str


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A disturbance location: a place that `unknown` shifts, in its own unit.

    `kind` is ``definition``, ``observer``, ``signal``, ``balance`` or ``reading``. `unit` is how
    values of the place are shown, SI = shown * factor. Of a law, `accuracy` is the share of
    its value within which it keeps.
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


@dataclass(frozen=True, kw_only=True)
class BaseParameters:
    """Parameters of the plain plant that recalibration may move, SI.

    `ids` are plan inputs such as ``A.k2``, all others stand in `constants`. `covariance`, shape
    (parameters, parameters), is the calibration's. `sheet` are value and standard uncertainty by
    the data sheet. Values lie between `lowest` and `highest`; those that are above zero by their
    meaning are `positive`; all three have shape (parameters,).
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
class Changed:
    """A parameter of the plain model, recalibrated (SI), for the repaired model."""

    id: str
    value: float
    u: float


@dataclass(frozen=True)
class Repair:
    """Values of a plant that can be written, SI.

    `joined` are ids of the candidates in it. `parameters` with their joint `covariance`, shape
    (parameters, parameters), those of joined candidates behind base parameters; `fixed` references
    of joined candidates; `misfit` what is left per observer, m3/s; `ranges` per signal the readings
    at which its relations were tested.
    """

    joined: tuple[str, ...]
    parameters: tuple[Changed, ...]
    covariance: Array
    fixed: Mapping[str, float]
    misfit: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]


class Unwritable(Exception):
    """A repair cannot be written as a plant; the message says why."""
