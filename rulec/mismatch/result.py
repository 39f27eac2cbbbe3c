"""What a comparison of simulation and recording found; the terminal, JSON and report show it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.mending import Mending

from rulec.effects.candidate import Changed, Repair
from rulec.effects.repair import why_refused
from rulec.knowledge.belief import Strain
from rulec.mismatch.candidate_sets import Standing

__all__ = ["Changed", "Repair"]


@dataclass(frozen=True)
class Region:
    """Where a mismatch shows: readings of `variable` between `low` and `high` (None: open).

    Numbers are in `unit`, as shown; `share` of the mismatch at that place lies inside.
    """

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
    """What is left out at a place over its driver, as shown.

    `at`, `value` and `u`, shape (n,), are the driver in `driver_unit`, what the law of that place
    would have to add in `unit`, from the level at which it begins, and its standard uncertainty.
    `means`, shape (m, 3), are the same of single operating states. `text` tells the shape in words;
    `monotone` whether it turns back nowhere. `memory` is ``yes``, ``no`` or ``cannot be told``:
    whether it matters from which side the driver came; `memory_text` says how far that is sure.
    `beaten` are names that were tried in its place, the nearest first.
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
    """A place that is wrong: `share` of the whole mismatch, where and when (periods in s).

    `title` tells the place in words; `also` lists places that no residual tells from it. `shape` is
    that of what has no name, where it follows a driver.
    """

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
    """A parameter as shown: value, standard uncertainty, 95 % profile interval, in `unit`."""

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
    """How a degree grows from nothing: by `rate` per hour, with its standard uncertainty and 95 %
    bounds; `u_since` (s) is that of the onset."""

    rate: float
    u: float
    lower: float
    upper: float
    u_since: float


@dataclass(frozen=True)
class Period:
    """A fault was there from `since` to `until` (s) at a degree: a share, or a size in `unit`.

    One with a `growth` was nothing at `since` and reached its degree at `until`.
    """

    since: float
    until: float
    degree: float
    u: float
    unit: str = ""
    growth: Growth | None = None


@dataclass(frozen=True, kw_only=True)
class Finding:
    """An explanation: `sort` is ``physics``, ``ageing``, ``fault``, ``sensor``, ``free`` or
    ``structure`` (a column is not what its header says, or a pipe not as the plant file does;
    `place` then holds ids of signals or outlets).

    `id` is that of the candidate; `gain` its own gain in log likelihood, prices paid (in settled
    plants on blocks that it was not fitted to, in plants that store on those it was), and `rivals`
    those that lost. `closed` is its share of the gains of all explanations.
    `members` lists all modules where it acts alike, empty for one module alone.
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

    @property
    def class_probability(self) -> float:
        """That it is this one or one of those that no recording of this kind tells from it."""
        same = sum(a.probability for a in self.alternatives if a.same)
        return self.probability + self.shapeless + same


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Root mean square errors of the predicted signal, as shown.

    `repaired` is that of the plant that `rulec adopt` writes; `explained` that of the whole
    explanation, with what no model may hold (faults, sensors, courses in time), NaN where it was
    not judged by this signal.
    """

    shipped: float
    recalibrated: float
    repaired: float
    noise: float
    points: int
    explained: float = float("nan")


@dataclass(frozen=True, kw_only=True)
class Fit:
    """How well the predicted signal is met; `gain_interval` is the 95 % block-bootstrap interval
    of the fall of the held-out error by the repair, as a share of the recalibrated error.

    `closed` is the share of the explainable mismatch (in squares) that is gone, held out.
    The errors are those of `simulated` plants, or else (and in the search) of the residual
    with the id `relation`, solved for the signal; None where only simulation tells the signal.
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
    """One of several recordings that were judged together.

    `rows` are those of it, of which `used` served for something. `verdict` is what it says alone,
    `alone` are the explanations that may be right by it, the likeliest first.
    """

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
    """What a further recording, by its name, changed of the probabilities before it, in words too;
    those first that are likeliest, before or after."""

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
    """A connection as `stated` in the plant file (None: it is not) and as it `fits` the readings
    (None: there is none), as ``A -> M1``; `edit` says what to change, with file and line."""

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
    """Course of something that drives a mismatch and is not recorded.

    `time` (s) and `course` have shape (n,), `course` in `unit` (of the place that it moves). One
    that `switches` does so with what the plant is set to.
    """

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
    """What anybody finds who simulates the written plant over the recording, as shown.

    `error` is the root mean square over the `rows` of the held-out spans that have a reading and a
    prediction; `plain` that of the recalibrated plant over the same rows.
    """

    signal: str
    rows: int
    error: float
    plain: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """For pictures; arrays of shape (n,), as shown; `heldout` flags points nothing was fitted to.

    `residual_before` is measured less recalibrated, `residual_after` measured less repaired;
    `drivers` maps titles (with unit) to readings, `inside` flags points whose errors count: those
    outside of periods of faults.
    """

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
    """What the three models predict of a signal; arrays of shape (n,), in `unit`, NaN: nothing.

    Where nothing was found `repaired` is `recalibrated`.
    """

    signal: str
    unit: str
    measured: Array
    shipped: Array
    recalibrated: Array
    repaired: Array


@dataclass(frozen=True)
class Series:
    """Courses of all predicted signals; `time`, s, and flags `heldout` have shape (n,)."""

    time: Array
    heldout: np.ndarray
    courses: tuple[Course, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Seen:
    """How often an effect is told that is concealed in replays of the recording.

    Of all replays it is `told` at its `size`, in `unit`: the one that was `found`, else the usual
    one; and `told_usual` at its `usual` size. `other` maps titles of what was told instead at its
    size to how often. `seen_from` is the smallest size that is told in half of the replays; None
    where none is. What no reading shows has no size (NaN).
    """

    id: str
    title: str
    size: float = float("nan")
    unit: str = ""
    told: int = 0
    other: Mapping[str, int] = field(default_factory=dict)
    usual: float = float("nan")
    told_usual: int = 0
    seen_from: float | None = None
    found: bool = False


@dataclass(frozen=True, kw_only=True)
class SelfProof:
    """What replays of the recording by the plant's own model say of the answer.

    In `called_missing` of the `replays` with nothing missing something was said to be missing.
    """

    replays: int
    called_missing: int
    effects: tuple[Seen, ...]


UNWRITTEN = Repair((), (), np.zeros((0, 0)), {}, {}, {})
"""Nothing that could be written."""


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """The whole answer.

    `verdict` is ``none``, ``named``, ``unnamed``, ``fault``, ``sensor``, ``ambiguous``, ``unsure``
    or ``cannot judge``. `strain` are parameters far from their data sheets. `fits` has one for each
    predicted signal, `fit` is the first. `split` says in
    words which blocks served for what, `digest` is its hash. `noise` says where the size of the
    noise comes from, `tried` how many explanations were tried. `repair` is the plant that `rulec
    adopt` writes, `plain` the recalibrated one, which can be written at any time. `left_out` are
    explanations that no model may hold, with the reason, `refused` says why nothing is to be
    written, empty where it may be. `checks` are for whoever writes a plant. `series` holds the
    courses of all `fits`; None where nothing was split. `evidence` counts every row of the
    recording once. `misread` are columns that were read otherwise than their header says: all that
    is told holds for the recording read so. Where several recordings were judged together,
    `recordings` has each, and `changed` what each further one changed. `seconds` is how long it
    took. `power` says what replays show, where that was asked for.
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
    standing: tuple[Standing, ...] = ()
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
