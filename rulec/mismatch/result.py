"""What a comparison of simulation and recording found; terminal, JSON and page show it.

Values are as shown, in their `unit`, times in s; arrays have shape (n,) where nothing else is said.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.mending import Mending

from rulec.effects.candidate import Changed, Repair
from rulec.effects.repair import why_refused
from rulec.knowledge.belief import Strain
from rulec.mismatch.candidate_sets import CandidateSet

__all__ = ["Changed", "Repair"]

NAN = float("nan")


@dataclass(frozen=True)
class Region:
    """Readings of `variable` between `low` and `high` (None: open), where `share` of the mismatch
    at a place lies."""

    variable: str
    low: float | None
    high: float | None
    unit: str
    share: float


@dataclass(frozen=True)
class Beaten:
    """A name that was tried in the place of a term without one: it fits worse by `nats`, most of
    that in `region` (None: everywhere)."""

    effect: str
    title: str
    nats: float
    region: Region | None


@dataclass(frozen=True, kw_only=True)
class Shape:
    """What is left out at a place over its driver.

    `at`, `value` and `u` are the driver, what the law would have to add, from the level at which it
    begins, and its standard uncertainty; `means`, shape (m, 3), the same of single operating
    states. `monotone`: it turns back nowhere. `memory` is ``yes``, ``no`` or ``cannot be told``:
    whether it matters from which side the driver came. `beaten` are names that were tried in its
    place, the nearest first.
    """

    driver: str
    driver_unit: str
    unit: str
    at: Array
    value: Array
    u: Array
    means: Array
    text: str
    monotone: bool
    memory: str
    memory_text: str
    beaten: tuple[Beaten, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Location:
    """A place that has `share` of the whole mismatch, where and when; `also` are places that no
    residual tells from it. What has no name and follows a driver has a `shape`."""

    module: str
    place: str
    title: str
    share: float
    region: tuple[Region, ...]
    periods: tuple[tuple[float, float], ...]
    also: tuple[str, ...] = ()
    shape: Shape | None = None


@dataclass(frozen=True)
class Estimate:
    """A parameter: value, standard uncertainty, and the ends of its 95 % profile interval."""

    title: str
    value: float
    u: float
    lower: float
    upper: float
    unit: str


@dataclass(frozen=True)
class Alternative:
    """Another explanation that fits about as well; one that is the `same` shows as the first."""

    id: str
    name: str
    title: str
    probability: float
    same: bool = False


@dataclass(frozen=True)
class Rival:
    """Something that must lose: its gain in log likelihood, to be compared with the finding's."""

    title: str
    gain: float


@dataclass(frozen=True, kw_only=True)
class Growth:
    """How a degree grows from nothing: `rate` per hour with standard uncertainty and 95 % bounds;
    `u_since` is that of the onset."""

    rate: float
    u: float
    lower: float
    upper: float
    u_since: float


@dataclass(frozen=True)
class Period:
    """A fault was there at a degree: a share, or a size in `unit`. One with a `growth` was nothing
    at `since` and reached its degree at `until`."""

    since: float
    until: float
    degree: float
    u: float
    unit: str = ""
    growth: Growth | None = None


@dataclass(frozen=True, kw_only=True)
class Finding:
    """An explanation.

    `sort` is ``physics``, ``ageing``, ``fault``, ``sensor``, ``free`` or ``structure`` (a column is
    not what its header says, or a pipe not as the plant file does; `place` then holds ids of
    signals or outlets). `gain` is its own in log likelihood, prices paid (of settled plants on
    blocks that it was not fitted to, of plants that store on those it was); `rivals` lost. `closed`
    is its share of the gains of all explanations. `members` are all modules where it acts alike,
    empty for one alone. A curve of its shape without a name has the probability `shapeless`; that
    only errors of laws and sensors are seen, `inexact`.
    """

    id: str
    sort: str
    name: str
    title: str
    module: str
    place: str
    parameters: Mapping[str, Estimate]
    equation: str
    text: str
    action: str
    source: str
    probability: float
    alternatives: tuple[Alternative, ...]
    gain: float
    rivals: tuple[Rival, ...]
    periods: tuple[Period, ...]
    closed: float
    members: tuple[str, ...] = ()
    shapeless: float = 0.0
    inexact: float = 0.0

    @property
    def class_probability(self) -> float:
        """That it is this one or one of those that no recording of this kind tells from it."""
        same = sum(a.probability for a in self.alternatives if a.same)
        return self.probability + self.shapeless + same


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Root mean square errors of a predicted signal.

    `repaired` is that of the plant that `rulec adopt` writes; `explained` that of the whole
    explanation, with what no model may hold (faults, sensors, courses in time), NaN where it was
    not judged by this signal.
    """

    shipped: float
    recalibrated: float
    repaired: float
    noise: float
    points: int
    explained: float = NAN


@dataclass(frozen=True, kw_only=True)
class Fit:
    """How well a predicted signal is met.

    `gain_interval` is the 95 % block-bootstrap interval of the fall of the held-out error by the
    repair, as a share of the recalibrated error; `closed` the share of the explainable mismatch (in
    squares) that is gone, held out. Errors are those of `simulated` plants, or else (and in the
    search) of the residual with the id `relation`, solved for the signal.
    """

    signal: str
    unit: str
    estimation: Errors
    heldout: Errors
    gain_interval: tuple[float, float]
    closed: float
    relation: str | None = None
    simulated: bool = False


@dataclass(frozen=True)
class Evidence:
    """So many rows of the recording served for something, or were not used, because."""

    rows: int
    used: bool
    because: str


@dataclass(frozen=True)
class Likely:
    """An explanation and its probability."""

    id: str
    title: str
    probability: float


@dataclass(frozen=True)
class OfRecording:
    """One of several recordings that were judged together: of its rows so many were used; what it
    says alone, and which explanations may be right by it, the likeliest first."""

    name: str
    rows: int
    used: int
    verdict: str
    alone: tuple[Likely, ...]


@dataclass(frozen=True)
class Moved:
    """An explanation with its probability before and after a further recording; `before` is None
    where the recordings before it could not be judged."""

    id: str
    title: str
    before: float | None
    after: float


@dataclass(frozen=True)
class Update:
    """What a further recording changed; those first that are likeliest, before or after."""

    recording: str
    text: str
    moved: tuple[Moved, ...]


@dataclass(frozen=True)
class Misread:
    """A column that is not what its header says, by kind, and how to read it."""

    kind: str
    mending: Mending


@dataclass(frozen=True, kw_only=True)
class Rewired:
    """A connection as the plant file has it and as it fits the readings, such as ``A -> M1`` (None:
    there is none); `edit` says what to change, with file and line."""

    stated: str | None
    fits: str | None
    edit: str


@dataclass(frozen=True)
class Confounded:
    """Two parameters that the recording does not tell apart."""

    first: str
    second: str
    correlation: float


@dataclass(frozen=True, kw_only=True)
class HiddenDriver:
    """Course of something that drives a mismatch and is not recorded, in `unit` of the place that
    it moves; one that `switches` does so with what the plant is set to."""

    module: str
    place: str
    text: str
    time: Array
    course: Array
    unit: str
    candidates: tuple[str, ...]
    sensor: str
    switches: bool = False


@dataclass(frozen=True, kw_only=True)
class Check:
    """What anybody finds who simulates the written plant over the recording: root mean square
    errors of the repaired and of the recalibrated plant over the `rows` of the held-out spans that
    have a reading and a prediction."""

    signal: str
    rows: int
    error: float
    plain: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """For pictures: what was measured and predicted. `heldout` flags points that nothing was fitted
    to, `inside` those whose errors count; `drivers` maps titles with unit to readings."""

    time: Array
    measured: Array
    shipped: Array
    recalibrated: Array
    repaired: Array
    heldout: np.ndarray
    drivers: Mapping[str, Array]
    inside: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Course:
    """What the three models predict of a signal, NaN: nothing; where nothing was found `repaired`
    is `recalibrated`."""

    signal: str
    unit: str
    measured: Array
    shipped: Array
    recalibrated: Array
    repaired: Array


@dataclass(frozen=True)
class Series:
    """Courses of all predicted signals."""

    time: Array
    heldout: np.ndarray
    courses: tuple[Course, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Detectability:
    """How often an effect is told that is concealed in replays of the recording.

    Of all replays it is `told` at its `size`: the one that was `found`, else the usual one; and
    `told_usual` at its `usual` size. `other` maps titles of what was told instead at its size to
    how often. `seen_from` is the smallest size that half of the replays tell. What no reading shows
    has no size (NaN).
    """

    id: str
    title: str
    size: float = NAN
    unit: str = ""
    told: int = 0
    other: Mapping[str, int] = field(default_factory=dict)
    usual: float = NAN
    told_usual: int = 0
    seen_from: float | None = None
    found: bool = False


@dataclass(frozen=True, kw_only=True)
class SelfProof:
    """What replays of the recording by the plant's own model say; with nothing missing something
    was said to be missing in `called_missing` of them."""

    replays: int
    called_missing: int
    effects: tuple[Detectability, ...]


UNWRITTEN = Repair((), (), np.zeros((0, 0)), {}, {}, {})
"""Nothing that could be written."""


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """The whole answer.

    `verdict` is ``none``, ``named``, ``unnamed``, ``fault``, ``sensor``, ``ambiguous``, ``unsure``
    or ``cannot judge``. `strain` are parameters far from their data sheets. `fits` has one for each
    predicted signal, `fit` is the first. `split` says which blocks served for what, `digest` is its
    hash. `tried` is how many explanations were tried. `repair` is the plant that `rulec adopt`
    writes, `plain` the recalibrated one. `left_out` are explanations that no model may hold, with
    the reason; `refused` says why nothing is to be written, empty where it may be. `checks` are for
    whoever writes a plant. `evidence` counts every row once. `misread` are columns that were read
    otherwise than their header says: all that is told holds for the recording read so.
    `recordings` are those that were judged together, `changed` what each further one changed.
    `power` says what replays show, where that was asked for.
    """

    plant: str
    title: str
    recording: str
    verdict: str
    headline: str
    next: str
    seconds: float
    locations: tuple[Location, ...] = ()
    findings: tuple[Finding, ...] = ()
    fit: Fit | None = None
    fits: tuple[Fit, ...] = ()
    confounded: tuple[Confounded, ...] = ()
    hidden: HiddenDriver | None = None
    untested: tuple[str, ...] = ()
    split: str = ""
    digest: str = ""
    noise: str = ""
    tried: int = 0
    notes: tuple[str, ...] = ()
    repair: Repair = UNWRITTEN
    plain: Repair | None = None
    left_out: tuple[tuple[str, str], ...] = ()
    refused: str = ""
    checks: tuple[Check, ...] = ()
    curves: Curves | None = None
    series: Series | None = None
    evidence: tuple[Evidence, ...] = ()
    misread: tuple[Misread, ...] = ()
    rewired: tuple[Rewired, ...] = ()
    standing: tuple[CandidateSet, ...] = ()
    recordings: tuple[OfRecording, ...] = ()
    changed: tuple[Update, ...] = ()
    strain: tuple[Strain, ...] = ()
    power: SelfProof | None = None

    @property
    def unproven(self) -> str:
        """Why the repair counts as not proven: what `rulec adopt` says; empty where it is, or there
        is none."""
        edits = [one.edit for one in self.rewired]
        return why_refused(edits, self.refused) if self.repair.joined else ""
