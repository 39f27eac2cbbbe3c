"""A recording cut into windows, half overlapping, long enough to show the effect of a fault."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Dynamics, Ruleset, SignalSpec
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.recordings.columns import filled, resolution, thinned, without_glitches
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.robust_statistics import white_noise
from rulec_runtime.recordings.stationary import systematic_u

NO_READING = "{}: no reading, or none within its range"


@dataclass(frozen=True, kw_only=True)
class Window:
    """Samples in a row.

    `inputs`, shape (n, given), are finite; `measured`, shape (n, outputs), is NaN where a sensor
    shows nothing, or the end of its range; SI. `piece` numbers runs without a pause, `first` is the
    first sample in it. If `because` is not empty, the window cannot be judged.
    """

    time: Array
    inputs: Array
    measured: Array
    piece: int
    first: int
    because: str

    @property
    def middle(self) -> float:
        """Time in its middle, s."""
        return float(0.5 * (self.time[0] + self.time[-1]))


@dataclass(frozen=True, kw_only=True)
class Windows:
    """Windows in order of time, each overlapping with half of the next of its piece.

    They are cut from `pieces`. `noise` is the standard deviation of white noise of each output,
    shape (outputs,), SI; `level` its median, `thinned` the number of samples averaged; `too_short`
    are pieces left out.
    """

    pieces: tuple[Window, ...]
    members: tuple[Window, ...]
    noise: Array
    level: Array
    thinned: int
    too_short: tuple[tuple[float, float], ...]

    def joined(self, one: Window, other: Window) -> Window:
        """All samples from the beginning of one window to the end of another of its piece."""
        piece = self.pieces[one.piece]
        part = slice(one.first, other.first + len(other.time))
        inputs = _without_gaps(piece.inputs[part])
        return replace(one, time=piece.time[part], inputs=inputs, measured=piece.measured[part])


def windows_of(recording: Recording, ruleset: Ruleset) -> Windows:
    """Cut a recording at pauses, thin it, and cut it into windows."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    factor = _averaged(len(recording))
    pieces = [
        _piece(recording, ruleset, dynamics, part, factor)
        for part in _pieces(recording)
        if part.stop - part.start >= factor
    ]
    count = sum(len(p.time) for p in pieces)
    length = _length(count)
    members: list[Window] = []
    short: list[tuple[float, float]] = []
    for number, piece in enumerate(pieces):
        if len(piece.time) < limits.FEWEST_IN_WINDOW:
            short.append((float(piece.time[0]), float(piece.time[-1])))
            continue
        members += [
            _window(dynamics, piece, a, b, number) for a, b in _cuts(len(piece.time), length)
        ]
    measured = np.concatenate([p.measured for p in pieces]) if pieces else np.zeros((0, 0))
    noise, level = _noise(ruleset, dynamics, pieces, measured)
    return Windows(
        pieces=tuple(pieces),
        members=tuple(members),
        noise=noise,
        level=level,
        thinned=factor,
        too_short=tuple(short),
    )


def rows_of_a_finding(count: int) -> int:
    """Rows of the windows that a finding needs, in a recording of so many rows."""
    factor = _averaged(count)
    return (limits.WINDOWS_IN_A_ROW + 1) * _length(count // factor) * factor // 2


def _averaged(count: int) -> int:
    return max(-(-count // limits.SAMPLES_FITTED), 1)


def _length(count: int) -> int:
    length = count // limits.WINDOWS_SIDE_BY_SIDE
    return int(np.clip(length, limits.SHORT_WINDOW, limits.LONG_WINDOW))


def _pieces(recording: Recording) -> Iterator[slice]:
    steps = np.diff(recording.time)
    longest = limits.PAUSE_STORES * float(np.median(steps)) if len(steps) else 0.0
    ends = np.flatnonzero((np.diff(recording.segment) != 0) | (steps > longest)) + 1
    edges = [0, *ends.tolist(), len(recording)]
    yield from (slice(a, b) for a, b in pairwise(edges) if b > a)


def _piece(
    recording: Recording, ruleset: Ruleset, dynamics: Dynamics, part: slice, factor: int
) -> Window:
    time = recording.time[part]
    blank = np.full(len(time), np.nan)

    def column(name: str) -> Array:
        return recording.values[name][part] if name in recording.values else blank

    inputs = {name: column(name) for name in dynamics.inputs}
    signals = [ruleset.signal_by_id[name] for name in dynamics.outputs]
    measured = {s.id: _inside(s, column(s.id)) for s in signals}
    time, inputs, measured = thinned(time, inputs, measured, factor)
    return Window(
        time=time,
        inputs=_table(inputs, len(time)),
        measured=_table(measured, len(time)),
        piece=0,
        first=0,
        because="",
    )


def _inside(signal: SignalSpec, values: Array) -> Array:
    """Readings without glitches or values at the ends of the range, which may hide larger ones."""
    if not np.isfinite(values).any():
        return values
    low, high = signal.ends
    with np.errstate(invalid="ignore"):
        return np.where((values > low) & (values < high), without_glitches(values)[0], np.nan)


def _table(columns: dict[str, Array], count: int) -> Array:
    return np.column_stack([*columns.values()]) if columns else np.zeros((count, 0))


def _without_gaps(table: Array) -> Array:
    return np.column_stack([*map(filled, table.T)]) if table.size else table


def _cuts(count: int, length: int) -> Iterator[tuple[int, int]]:
    """First and last (excluded) sample of windows that overlap by half; they fill the piece."""
    if count <= length:
        yield 0, count
        return
    number = 1 + int(np.ceil(2 * (count - length) / length))
    for first in np.linspace(0, count - length, number).astype(int).tolist():
        yield first, first + length


def _window(dynamics: Dynamics, piece: Window, first: int, last: int, number: int) -> Window:
    inputs, measured = piece.inputs[first:last], piece.measured[first:last]
    there = np.isfinite(inputs).mean(axis=0) if len(inputs) else np.zeros(0)
    shown = np.isfinite(measured).mean(axis=0)
    because = [
        f"{name} has no reading"
        for name, s in zip(dynamics.inputs, there, strict=True)
        if s < limits.WINDOW_KNOWN
    ]
    if not (shown >= limits.WINDOW_KNOWN).any():
        some = [bool(np.isfinite(column).any()) for column in piece.measured.T]
        names = [n for n, s in zip(dynamics.outputs, some, strict=True) if s] or dynamics.outputs
        because.append(NO_READING.format(" and ".join(names)))
    if not because:
        inputs = _without_gaps(inputs)
    return Window(
        time=piece.time[first:last],
        inputs=inputs,
        measured=measured,
        piece=number,
        first=first,
        because="; ".join(because),
    )


def _noise(
    ruleset: Ruleset, dynamics: Dynamics, pieces: Sequence[Window], measured: Array
) -> tuple[Array, Array]:
    """White noise from third differences, at least the resolution, and median of each output."""
    noise, level = np.ones(len(dynamics.outputs)), np.zeros(len(dynamics.outputs))
    for i, name in enumerate(dynamics.outputs):
        values = measured[:, i] if len(measured) else np.zeros(0)
        if not np.isfinite(values).any():
            continue
        third = np.concatenate([np.diff(p.measured[:, i], 3) for p in pieces])
        white = white_noise(third[np.isfinite(third)], 3)
        level[i] = float(np.nanmedian(values))
        signal = ruleset.signal_by_id[name]
        least = common.NO_CHANGE * float(systematic_u(signal, level[i]))
        noise[i] = max(white, resolution(values, signal), least)
    return noise, level
