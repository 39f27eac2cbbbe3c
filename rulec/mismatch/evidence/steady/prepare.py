"""Settled points of a recording, and the use of each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ObserverSpec, Ruleset
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.steady.points import Points, points_of_stretches, rounding
from rulec_runtime.limits import LONGEST_STRETCH
from rulec_runtime.recordings.point_table import each_row, follows_a_course, is_point_table
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import (
    Stretches,
    find_stretches,
    noise_at_work,
    systematic_u,
)
from rulec_runtime.report.text import counted, fixed

from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.model import (
    ESTIMATION,
    HELDOUT,
    PATTERN,
    SELECTION,
    Samples,
    digest_of,
    inside_of,
)

UNSETTLED, SPARED = -1, -2
"""Instead of the number of a point: a sample that is not settled, and a settled one that was
omitted because there are so many."""


@dataclass(frozen=True, kw_only=True)
class Data(Samples):
    """Settled points.

    `block`, shape (n,), is the number of the block of each. `noise` is the statistical standard
    uncertainty of each reading of a point, and `rounding` the part of it by a display with coarse
    steps, which a mean of several points has as well. With `of_rows`, each row of the recording is
    a settled point of its own; `stretches` are the rows of each point. `moving` are flags per
    module, shape (n,): while one ramps, others may be settled. `sample`, shape (samples,), is the
    number of the point of each sample of the recording, or `UNSETTLED` or `SPARED`. `source`, shape
    (n,), is the number of the recording of each point, `sources` are their names, none for a single
    recording. `clock`, s, shape (n,), is the time since the start of the recording of each, or of
    the first one if all have one clock.
    """

    points: Points
    noise: Mapping[str, Array]
    rounding: Mapping[str, float]
    block: NDArray[np.intp]
    of_rows: bool
    moving: Mapping[str, np.ndarray]
    stretches: Stretches
    sample: NDArray[np.intp]
    source: NDArray[np.intp]
    sources: tuple[str, ...]
    clock: Array

    def __len__(self) -> int:
        return len(self.time)

    @property
    def values(self) -> Mapping[str, Array]:
        """Readings, shape (n,), SI."""
        return self.points.values


def prepare(
    recording: Recording, ruleset: Ruleset, heldout: Sequence[tuple[float, float]] = ()
) -> Data | None:
    """Find the settled points; None where there are none.

    Failed readings are removed without regard to the model, which is what is in doubt here.
    """
    recording = examine(recording, ruleset, by_model=False).recording
    noise = noise_at_work(recording, ruleset)
    of_rows = is_point_table(recording, ruleset)
    if of_rows:
        stretches = each_row(recording)
        moving: dict[str, np.ndarray] = {}
        noise = dict.fromkeys(noise, 0.0)
        rests = np.ones(len(recording), dtype=bool)
    else:
        stretches, moving, rests = settled_parts(recording, ruleset, noise)
    if not len(stretches):
        return None
    points = points_of_stretches(recording, ruleset, stretches, noise)
    assert points.time is not None
    time = points.time
    points = _bridged(points, {s for o in ruleset.observers for s in o.signals})
    statistical, rounded = {}, {}
    for signal in ruleset.signals:
        if signal.id in points.values:
            rounded[signal.id] = rounding(signal, recording, noise[signal.id])
            floor = limits.STATISTICAL_SHARE * systematic_u(signal, points.values[signal.id])
            own = points.statistical(signal.id)
            # A reading that quantisation or filtering makes constant is not exact.
            smallest = floor if of_rows else limits.FLOOR_SHARE * floor / np.sqrt(stretches.lengths)
            statistical[signal.id] = np.maximum(own, smallest)
    first = stretches.first
    source = np.zeros(len(time), np.intp) if recording.source is None else recording.source[first]
    clock = time - (time[0] if recording.origin is None else recording.origin[first])
    block, part = _split(time, source, heldout)
    return Data(
        points=points,
        time=time,
        noise=statistical,
        rounding=rounded,
        block=block,
        part=part,
        of_rows=of_rows,
        split=_split_in_words(time, part, block, heldout),
        digest=digest_of(time, part),
        moving=moving,
        stretches=stretches,
        sample=_points_of_samples(stretches, rests),
        source=source,
        sources=recording.sources,
        clock=clock,
        timed=recording.one_clock and (not of_rows or follows_a_course(recording, ruleset)),
    )


def _points_of_samples(stretches: Stretches, rests: np.ndarray) -> NDArray[np.intp]:
    """Number of the point of each sample, shape (samples,); `rests` flags settled samples."""
    sample: NDArray[np.intp] = np.where(rests, SPARED, UNSETTLED)
    for i, (low, high) in enumerate(zip(stretches.first, stretches.last, strict=True)):
        sample[low:high] = i
    return sample


def settled_parts(
    recording: Recording, ruleset: Ruleset, noise: Mapping[str, float]
) -> tuple[Stretches, dict[str, np.ndarray], np.ndarray]:
    """Pieces of time in which some modules rest, flags per module of pieces in which it moves, and
    flags of samples in which some module rests, shape (samples,).

    Pumps that run one by one seldom all rest at once.
    """
    own: dict[str, list[ObserverSpec]] = {}
    for observer in ruleset.observers:
        own.setdefault(observer.module, []).append(observer)
    n = len(recording)
    number = np.full((len(own), n), -1)
    for row, observers in zip(number, own.values(), strict=True):
        found = find_stretches(recording, ruleset, noise, observers, n)
        for i, (low, high) in enumerate(zip(found.first, found.last, strict=True)):
            row[low:high] = i
    rests: np.ndarray = np.any(number >= 0, axis=0)
    changes = np.any(np.diff(number, axis=1) != 0, axis=0)
    first = np.flatnonzero(np.concatenate([[True], changes]))
    last = np.append(first[1:], n)
    resting = rests[first]
    pieces = _pieces(Stretches(first[resting], last[resting]), len(ruleset.observers))
    moving = {module: row[pieces.first] < 0 for module, row in zip(own, number, strict=True)}
    return pieces, moving, rests


def _bridged(points: Points, read: set[str]) -> Points:
    """Bridge gaps in readings that no estimate needs: they may still drive an effect."""
    assert points.time is not None
    values = dict(points.values)
    for name, course in points.values.items():
        finite = np.isfinite(course)
        if name not in read and not finite.all() and finite.mean() > limits.BRIDGED:
            values[name] = np.interp(points.time, points.time[finite], course[finite])
    return replace(points, values=values)


def _pieces(stretches: Stretches, observers: int) -> Stretches:
    """Cut stretches into about as many points as the budget allows."""
    budget = limits.POINT_BUDGET // max(observers, 1)
    length = min(max(1, -(-int(stretches.lengths.sum()) // budget)), LONGEST_STRETCH)
    if not len(stretches):
        return stretches
    ends = zip(stretches.first, stretches.last, strict=True)
    edges = [np.linspace(a, b, max(1, round((b - a) / length)) + 1).astype(int) for a, b in ends]
    first, last = (np.concatenate([e[part] for e in edges]) for part in (slice(-1), slice(1, None)))
    pieces = Stretches(first, last)
    if len(pieces) <= 1.5 * budget:
        return pieces
    # Of many short stretches a fraction is kept, each of them whole.
    keep = np.arange(len(pieces)) % (-(-len(pieces) // budget)) == 0
    return Stretches(pieces.first[keep], pieces.last[keep])


def _split(
    time: Array, source: NDArray[np.intp], heldout: Sequence[tuple[float, float]]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Number of the block of each point, and its use; each recording is split by itself."""
    block, part = np.zeros(len(time), np.intp), np.zeros(len(time), np.intp)
    behind = 0
    for own in np.unique(source):
        here = source == own
        inner, part[here] = _split_of_one(time[here], heldout)
        block[here] = behind + inner
        behind += int(inner.max()) + 1
    return block, part


def _split_of_one(
    time: Array, heldout: Sequence[tuple[float, float]]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    inside = inside_of(time, heldout)
    rest, count = np.cumsum(~inside) - 1, max(int((~inside).sum()), 1)
    blocks = int(np.clip(count // limits.BLOCK_POINTS, 1, common.BLOCKS))
    open_ = np.clip(rest * blocks // count, 0, blocks - 1)
    if not heldout:
        return open_, np.array(PATTERN)[open_ % len(PATTERN)]
    own = blocks + np.arange(len(time)) * common.BLOCKS // max(len(time), 1)
    block = np.unique(np.where(inside, own, open_), return_inverse=True)[1]
    return block, np.where(inside, HELDOUT, open_ % 2)


def _split_in_words(
    time: Array, part: NDArray[np.intp], block: NDArray[np.intp], heldout: Sequence[object]
) -> str:
    counts = [fixed(int((part == p).sum()), 0) for p in (ESTIMATION, SELECTION, HELDOUT)]
    chosen = "as asked" if heldout else "every fifth block"
    return (
        f"{counted(len(time), 'settled point')} in {len(np.unique(block))} blocks of time: "
        f"{counts[0]} for estimation, {counts[1]} for selection, {counts[2]} held out ({chosen})"
    )
