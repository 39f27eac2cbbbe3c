"""The result of a comparison of simulation and recording, for terminal, JSON and page.

Values are as shown, in their `unit`, times in s; arrays have shape (n,) unless stated otherwise.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.header_correction import Mending

from rulec.effects.candidate import Changed, Repair
from rulec.effects.repair import why_refused
from rulec.knowledge.parameter_belief import Strain


class MismatchRefused(Refusal):
    """The comparison cannot be made."""


class ExperimentRefused(Refusal):
    """No experiment can be planned."""


@dataclass(frozen=True)
class Presence:
    """When something is present: the periods of an unknown, s, each with the number of its level,
    and whether it grows from zero in the last one."""

    unknown: str
    spans: tuple[tuple[float, float, int], ...]
    grows: bool


@dataclass(frozen=True, kw_only=True)
class CandidateSet:
    """A set of explanations that is still possible.

    `names` are those of the search, `titles` the same in words; both are empty if nothing is
    missing. The rest describes its fit, SI: ids of `joined` candidates, `values` and `fixed`
    numbers by id, `periods`, and per term without a name its name and its correlation length as a
    share of its driver's range.
    """

    names: tuple[str, ...]
    titles: tuple[str, ...]
    probability: float
    joined: tuple[str, ...]
    values: Mapping[str, float]
    fixed: Mapping[str, float]
    periods: tuple[Presence, ...]
    terms: tuple[tuple[str, float], ...]


__all__ = ["Changed", "Repair"]

NAN = float("nan")

UNDECIDED = "cannot be told"
"""Where the recording does not show whether a place has a memory."""


@dataclass(frozen=True)
class Region:
    """Readings of `variable` from `low` to `high` (None: open); `share` of a place's mismatch."""

    variable: str
    low: float | None
    high: float | None
    unit: str
    share: float


@dataclass(frozen=True)
class Beaten:
    """A named effect that was tried instead of a term without a name: it fits worse by `nats`,
    mostly in `region` (None: everywhere)."""

    effect: str
    title: str
    nats: float
    region: Region | None


@dataclass(frozen=True, kw_only=True)
class Shape:
    """The missing term at a place over its driver.

    `at` is the driver, `value` the missing term relative to the level at which it begins, and `u`
    its standard uncertainty; `means`, shape (m, 3), are the same for single operating states.
    `monotone`: it has no turning point. `memory` is ``yes``, ``no`` or `UNDECIDED`: whether
    it matters from which side the driver came. `beaten` are named effects that were tried instead,
    the nearest first.
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
    """A place with a `share` of the whole mismatch, where and when; `also` are places that no
    residual distinguishes from it. A term without a name that follows a driver has a `shape`."""

    module: str
    place: str
    title: str
    share: float = NAN
    region: tuple[Region, ...] = ()
    periods: tuple[tuple[float, float], ...] = ()
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
    """Another explanation that fits about as well; the `same`: with the same signature."""

    id: str
    name: str
    title: str
    probability: float
    same: bool = False


@dataclass(frozen=True)
class Rival:
    """A rival that must lose: its gain in log likelihood, to be compared with the finding's."""

    title: str
    gain: float


@dataclass(frozen=True, kw_only=True)
class Growth:
    """Growth of a degree from zero: `rate` per hour with standard uncertainty and 95 % bounds;
    `u_since` is the standard uncertainty of the onset."""

    rate: float
    u: float
    lower: float
    upper: float
    u_since: float


@dataclass(frozen=True)
class Period:
    """A period of a fault with a degree: a share, or a size in `unit`. With `growth`, it grew from
    zero at `since` to its degree at `until`."""

    since: float
    until: float
    degree: float
    u: float
    unit: str = ""
    growth: Growth | None = None


@dataclass(frozen=True, kw_only=True)
class Finding:
    """An explanation.

    `sort` is ``physics``, ``ageing``, ``fault``, ``sensor``, ``free`` or ``structure`` (a column
    differs from its header, or a pipe from the plant file; `place` then holds ids of signals or
    outlets). `gain` is its own gain in log likelihood after prices (of settled plants on held-out
    blocks, of plants that store on fitted ones); `rivals` lost. `closed` is its share of the gains
    of all explanations. `members` are all modules that it affects alike, empty for a single one.
    `shapeless` is the probability of a curve of its shape without a name, `inexact` that only
    errors of laws and sensors are present.
    """

    id: str
    sort: str
    name: str
    title: str
    module: str
    place: str
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    equation: str = ""
    text: str
    action: str
    source: str = ""
    probability: float
    alternatives: tuple[Alternative, ...] = ()
    gain: float = 0.0
    rivals: tuple[Rival, ...] = ()
    periods: tuple[Period, ...] = ()
    closed: float = 0.0
    members: tuple[str, ...] = ()
    shapeless: float = 0.0
    inexact: float = 0.0

    @property
    def class_probability(self) -> float:
        """Probability of this explanation or one that recordings cannot distinguish from it."""
        same = sum(a.probability for a in self.alternatives if a.same)
        return self.probability + self.shapeless + same


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Root mean square errors of a predicted signal.

    `repaired` is of the plant that `rulec adopt` writes; `explained` is of the whole explanation,
    including what no model may hold (faults, sensors, courses in time), NaN if this signal was not
    used to judge it.
    """

    shipped: float
    recalibrated: float
    repaired: float
    noise: float
    points: int
    explained: float = NAN


@dataclass(frozen=True, kw_only=True)
class Fit:
    """How well a signal is predicted.

    `gain_interval` is the 95 % block-bootstrap interval of the fall of the held-out error by the
    repair, as a share of the recalibrated error; `closed` is the share of the explainable mismatch
    (in squares) that it closes, held out. Errors are of `simulated` plants, or else (and in the
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
    """A number of rows of the recording and what they were used for, or why they were not used."""

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
    """One of several recordings judged together: its rows and how many were used, its own verdict,
    and the explanations that it allows, most probable first."""

    name: str
    rows: int
    used: int
    verdict: str
    alone: tuple[Likely, ...]


@dataclass(frozen=True)
class Moved:
    """An explanation with its probability before and after a further recording; `before` is None if
    the earlier recordings could not be judged."""

    id: str
    title: str
    before: float | None
    after: float


@dataclass(frozen=True)
class Update:
    """The change by a further recording, the most probable explanations first."""

    recording: str
    text: str
    moved: tuple[Moved, ...]


@dataclass(frozen=True)
class Misread:
    """A column that differs from its header, by kind, and how to read it."""

    kind: str
    mending: Mending


@dataclass(frozen=True, kw_only=True)
class Rewired:
    """A connection as in the plant file and as it fits the readings, such as ``A -> M1`` (None:
    none); `edit` says what to change, with file and line."""

    stated: str | None
    fits: str | None
    edit: str


@dataclass(frozen=True)
class Confounded:
    """Two parameters that the recording does not separate."""

    first: str
    second: str
    correlation: float


@dataclass(frozen=True, kw_only=True)
class LatentInput:
    """Course of an unrecorded driver of a mismatch, in `unit` of the place that it affects; it
    `switches` with the set points, if so."""

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
    """What any user finds who simulates the written plant over the recording: root mean square
    errors of the repaired and of the recalibrated plant over the `rows` of the held-out spans with
    a reading and a prediction."""

    signal: str
    rows: int
    error: float
    plain: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """For pictures: measured and predicted values. `heldout` flags points that were not fitted,
    `inside` those whose errors count; `drivers` maps titles with unit to readings."""

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
    """Predictions of a signal by the three models, NaN if there is none; without a finding
    `repaired` is `recalibrated`."""

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
    """How often an effect is found that is concealed in replays of the recording.

    It is found in `told` replays at its `size`, the one that was `found` or else the usual one, and
    in `told_usual` at its `usual` size. `other` counts what was found instead at its size, by
    title. `seen_from` is the smallest size that half of the replays reveal. An effect without
    influence on any reading has no size (NaN).
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
    """Results of replays of the recording by the plant's own model; with nothing missing, something
    counted as missing in `called_missing` of them."""

    replays: int
    called_missing: int
    effects: tuple[Detectability, ...]


UNWRITTEN = Repair((), (), np.zeros((0, 0)), {}, {}, {})
"""An empty repair."""


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """The whole answer.

    `verdict` is ``none``, ``named``, ``unnamed``, ``fault``, ``sensor``, ``ambiguous``, ``unsure``
    or ``cannot judge``. `strain` are parameters far from their data sheets. `fits` has one entry
    for each predicted signal, `fit` is the first. `split` says how blocks were used, `digest` is
    its hash. `tried` is the number of explanations tried. `repair` is the plant that `rulec adopt`
    writes, `plain` the recalibrated one. `left_out` are explanations that no model may hold, with
    the reason; `refused` says why nothing should be written, empty if it may be. `checks` are for
    whoever writes a plant. `evidence` counts every row once. `misread` are columns that differ from
    their header; the answer holds for the corrected recording. `recordings` are those judged
    together, `changed` the change by each further one. `power` has the results of replays, if
    requested.
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
    latent_input: LatentInput | None = None
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
        """Why the repair is not proven, as `rulec adopt` says; empty if it is or there is none."""
        edits = [one.edit for one in self.rewired]
        return why_refused(edits, self.refused) if self.repair.joined else ""
