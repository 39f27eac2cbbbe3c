"""The interface between answers and a fitted model of any plant."""

import hashlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec, StateSpec
from rulec_runtime.recordings.columns import runs_where
from rulec_runtime.recordings.recording import Recording

from rulec.effects.candidate import Candidate, Unknown
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch.evidence import limits
from rulec.mismatch.result import Estimate, Evidence, Period, Region

# Samples of a recording, and the use of each block of them.
#
# Samples are split by blocks of time, never singly: neighbours are correlated, so a sample between
# two others tests nothing.

ESTIMATION, SELECTION, HELDOUT = 0, 1, 2

PATTERN = (ESTIMATION, SELECTION, HELDOUT, SELECTION, ESTIMATION)
"""Use of the blocks of a recording, in turn."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Samples in order of time.

    `time`, s, and `part`, one of the numbers above, have shape (n,). `split` describes the split in
    words, `digest` is its hash. `timed` samples have a common clock; otherwise nothing can follow
    time.
    """

    time: Array
    part: NDArray[np.intp]
    split: str
    digest: str
    timed: bool = True

    @property
    def open(self) -> np.ndarray:
        """Flags of samples that are not held out, shape (n,)."""
        return np.asarray(self.part != HELDOUT)


def digest_of(time: Array, part: NDArray[np.intp]) -> str:
    """Hash of a split; `time`, s, and `part` have shape (n,)."""
    data = np.ascontiguousarray(time).tobytes() + part.astype("i1").tobytes()
    return hashlib.sha256(data).hexdigest()[:16]


def inside_of(time: Array, spans: Sequence[tuple[float, float]]) -> np.ndarray:
    """Flags of samples within some spans of time, s, ends included, shape (n,)."""
    inside: np.ndarray = np.zeros(len(time), dtype=bool)
    for low, high in spans:
        inside |= (time >= low) & (time <= high)
    return inside


# Count the rows of a recording by their use, and by why others were not used.
#
# Every row is counted once, so that the counts sum to all rows: nothing is omitted unreported.

SEARCHED = "for search and fit"
HELD_OUT = "held out"


def counted_rows(used: Iterable[str], unused: Iterable[str]) -> tuple[Evidence, ...]:
    """Counts of rows by their use, used ones first, then by falling number."""
    found = []
    for served, texts in ((True, used), (False, unused)):
        counts = sorted(Counter(texts).items(), key=lambda entry: (-entry[1], entry[0]))
        found += [Evidence(rows, served, because) for because, rows in counts]
    return tuple(found)


def unread(recording: Recording) -> list[str]:
    """Why each row of the files that is no part of the recording was left out."""
    return [because for rows, because in recording.left_out for _ in range(rows)]


@dataclass(frozen=True)
class Variable:
    """A course, SI, shape (n,), with the factor, offset and unit of its display."""

    course: Array
    factor: float
    offset: float
    unit: str

    @classmethod
    def of(cls, course: Array, own: SignalSpec | StateSpec) -> Self:
        """The course, SI, of a reading or of a state."""
        return cls(course, own.factor, own.offset, own.unit)

    def shown(self, values: Array | float) -> Array:
        """Values in SI, any shape, converted to the unit."""
        return np.asarray((values - self.offset) / self.factor)


@dataclass(frozen=True, kw_only=True)
class Line:
    """The likelihood along one value, SI, with all other values refitted.

    `u` is the standard uncertainty of the linearised model, `least` the smallest one to report.
    `fall` gives the fall of the log likelihood at a signed step from `value`.
    """

    value: float
    u: float
    least: float
    lowest: float
    highest: float
    fall: Callable[[float], float]


@dataclass(frozen=True, kw_only=True)
class Model(ABC):
    """A fitted model; `joined` are its explanations.

    `free` are the ids of the values in `covariance`, SI, shape (free, free).
    """

    ruleset: Ruleset
    builder: ModelBuilder
    samples: Samples
    joined: tuple[Candidate, ...]
    free: tuple[str, ...]
    covariance: Array

    @abstractmethod
    def line(self, name: str) -> Line:
        """The likelihood along a free value."""

    @abstractmethod
    def periods(
        self, candidate: Candidate, estimates: Mapping[str, Estimate]
    ) -> tuple[Period, ...]:
        """Periods of a fault and its degrees; none for a permanent one."""

    @abstractmethod
    def term(self, candidate: Candidate) -> Array:
        """Squared change by a candidate per sample, shape (n,); NaN where it was not fitted."""

    @abstractmethod
    def variables(self, module: str) -> Mapping[str, Variable]:
        """Courses that may define a region, those of the module first."""

    @abstractmethod
    def variable(self, name: str) -> Variable | None:
        """One course; None where it is not recorded."""


def unit_of_size(degree: Unknown) -> str:
    """The unit of a degree, empty for a share."""
    return "" if degree.unit == "%" else degree.unit


def region_of(contribution: Array, variables: Mapping[str, Variable]) -> tuple[Region, ...]:
    """The range of one variable in which a mismatch shows.

    Parameters
    ----------
    contribution : shape (n,), part of each sample in the mismatch, not negative; NaN: unknown.
    variables : by id, courses of shape (n,).
    """
    finite = np.isfinite(contribution)
    total = float(np.sum(contribution[finite]))
    if total <= 0:
        return ()
    best: tuple[float, Region] | None = None
    for name, variable in variables.items():
        ends = best_interval(variable.course[finite], contribution[finite] / total)
        if ends is None:
            continue
        gain, low, high, share = ends
        shown = [None if v is None else float(variable.shown(v)) for v in (low, high)]
        if best is None or gain > best[0] + limits.REGION_CLEARER:
            best = (gain, Region(name, shown[0], shown[1], variable.unit, share))
    return (best[1],) if best is not None and best[0] > limits.REGION_TELLING else ()


def best_interval(
    values: Array, shares: Array
) -> tuple[float, float | None, float | None, float] | None:
    """Interval with most of the mismatch in few of the points; None where nothing varies.

    `values` of a reading and `shares` of the mismatch have shape (n,). Returns the index, both ends
    (None: open) and the share inside.

    Source: Youden 1950 for the index.
    """
    usable = np.isfinite(values)
    values, shares = values[usable], shares[usable]
    if len(values) < limits.REGION_POINTS or np.ptp(values) == 0:
        return None
    order = np.argsort(values, kind="stable")
    values = values[order]
    inside = np.concatenate([[0.0], np.cumsum(shares[order])])
    n = len(values)
    ends = np.unique(np.linspace(0, n, limits.REGION_ENDS + 1).astype(int))
    low, high = np.meshgrid(ends, ends, indexing="ij")
    gain = np.where(high > low, (inside[high] - inside[low]) - (high - low) / n, -np.inf)
    i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
    first, last = int(ends[i]), int(ends[j])
    return (
        float(gain[i, j]),
        float(values[first]) if first else None,
        float(values[last - 1]) if last < n else None,
        float(inside[last] - inside[first]),
    )


def where_most(
    values: Array, parts: Array
) -> tuple[tuple[float | None, float | None] | None, float]:
    """Range of a reading (None: open) that contains most of the `parts`, and their share there.

    `values` and `parts`, not negative, have shape (n,). None and 0 where they are spread out.
    """
    if not parts.sum() > 0.0:
        return None, 0.0
    ends = best_interval(values, parts / parts.sum())
    if ends is None or ends[0] < limits.REGION_TELLING:
        return None, 0.0
    return (ends[1], ends[2]), ends[3]


def periods_of(time: Array, contribution: Array) -> tuple[tuple[float, float], ...]:
    """Spans of time, s, that contain most of a mismatch; none where it is spread out.

    `time`, s, and `contribution`, not negative, NaN: unknown, have shape (n,).
    """
    finite = np.flatnonzero(np.isfinite(contribution))
    if len(finite) < limits.PERIOD_SAMPLES or np.sum(contribution[finite]) <= 0:
        return ()
    pieces = np.array_split(finite, min(limits.PERIOD_PIECES, len(finite) // 5))
    level = np.array([float(np.mean(contribution[p])) for p in pieces])
    high = level > limits.PERIOD_LEVEL * float(np.quantile(level, limits.PERIOD_HIGHEST))
    if high.mean() > limits.PERIOD_TIME:
        return ()
    runs = runs_where(high, 1)
    if (
        len(runs) > limits.PERIODS_MOST
        or sum(level[a:b].sum() for a, b in runs) < limits.PERIOD_SHARE * level.sum()
    ):
        return ()
    return tuple((float(time[pieces[a][0]]), float(time[pieces[b - 1][-1]])) for a, b in runs)
