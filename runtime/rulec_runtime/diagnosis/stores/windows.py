"""A recording cut into windows, half overlapping, long enough to show the effect of a fault."""

from collections.abc import Iterable, Iterator, Sequence
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
    first sample in it. If `because` is not empty, the window cannot be judged. `slips` is how far
    each input may be off until the next sample, as it may jump at any moment in between: root mean
    square, with the sign of the jump, of the shape of `inputs`; `noise` is the standard deviation
    of the white noise of each input, shape (given,). What both do to the outputs is in `jumps`, and
    what the form of laws does in `forms`, each shape (n, outputs, errors). See `bent_by`.
    """

    time: Array
    inputs: Array
    measured: Array
    slips: Array | None = None
    noise: Array | None = None
    jumps: Array | None = None
    forms: Array | None = None
    bent: np.ndarray | None = None
    piece: int = 0
    first: int = 0
    because: str = ""

    @property
    def middle(self) -> float:
        """Time in its middle, s."""
        return float(0.5 * (self.time[0] + self.time[-1]))

    @property
    def completeness(self) -> Array:
        """Share of the samples in which each output was measured, shape (outputs,)."""
        return np.asarray(np.isfinite(self.measured).mean(axis=0))


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
        assert piece.slips is not None
        return replace(
            one,
            time=piece.time[part],
            inputs=_without_gaps(piece.inputs[part]),
            measured=piece.measured[part],
            slips=piece.slips[part],
            jumps=None,
            forms=None,
            bent=None,
        )


def windows_of(recording: Recording, ruleset: Ruleset) -> Windows:
    """Cut a recording at pauses, thin it, and cut it into windows."""
    dynamics, factor = ruleset.dynamics, _averaged(len(recording))
    assert dynamics is not None
    parts = [part for part in _parts(recording) if part.stop - part.start >= factor]
    pieces = [_piece(recording, ruleset, dynamics, part, factor) for part in parts]
    length = _length(sum(len(piece.time) for piece in pieces))
    noise, level = _noise(ruleset, dynamics, pieces)
    is_long = [len(piece.time) >= limits.FEWEST_IN_WINDOW for piece in pieces]
    return Windows(
        pieces=tuple(pieces),
        members=tuple(
            _window(dynamics, pieces[number], number, slice(first, first + length), factor > 1)
            for number in np.flatnonzero(is_long).tolist()
            for first in _firsts(len(pieces[number].time), length)
        ),
        noise=noise,
        level=level,
        thinned=factor,
        too_short=tuple(
            (float(piece.time[0]), float(piece.time[-1]))
            for piece, long in zip(pieces, is_long, strict=True)
            if not long
        ),
    )


def bent_by(slips: Array) -> np.ndarray:
    """Flags of samples, shape (n,), whose readings are means over times before and behind a jump:
    the balances give the value in the middle."""
    bent = np.zeros(len(slips), dtype=bool)
    for sample, _ in jumps_of(slips):
        bent[sample : sample + 2] = True
    return bent


def rows_of_a_finding(count: int) -> int:
    """Rows of the windows that a finding needs, in a recording of so many rows."""
    factor = _averaged(count)
    return (limits.WINDOWS_IN_A_ROW + 1) * _length(count // factor) * factor // 2


def _averaged(count: int) -> int:
    return max(-(-count // limits.SAMPLES_FITTED), 1)


def _length(count: int) -> int:
    length = count // limits.WINDOWS_SIDE_BY_SIDE
    return int(np.clip(length, limits.SHORT_WINDOW, limits.LONG_WINDOW))


def _parts(recording: Recording) -> Iterator[slice]:
    """Runs of rows without a pause."""
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
    names = (*dynamics.inputs, *dynamics.outputs)
    there = {n: recording.values[n][part] if n in recording.values else blank for n in names}
    inputs = {name: there[name] for name in dynamics.inputs}
    measured = {n: _inside(ruleset.signal_by_id[n], there[n]) for n in dynamics.outputs}
    steps = {n: np.diff(values, append=values[-1:]) for n, values in inputs.items()}
    _, squares, _ = thinned(time, {n: step**2 for n, step in steps.items()}, {}, factor)
    _, steps, _ = thinned(time, steps, {}, factor)
    time, inputs, measured = thinned(time, inputs, measured, factor)
    columns = (inputs, measured, squares, steps)
    tables = [_table(each.values(), len(time)) for each in columns]
    slips = limits.UNIFORM * np.sign(tables[3]) * np.sqrt(tables[2] / factor)
    noise = [white_noise(d[np.isfinite(d)], 3) for d in np.diff(tables[0], 3, axis=0).T]
    return Window(
        time=time,
        inputs=tables[0],
        measured=tables[1],
        slips=np.nan_to_num(slips),
        noise=np.array(noise),
    )


def input_errors(window: Window) -> Iterator[Array]:
    """Errors of the inputs that recur in no other window, each by its standard deviation, of the
    shape of `inputs`: the moment of each jump, and the noise of some samples together."""
    assert window.slips is not None
    assert window.noise is not None
    for jump in jumps_of(window.slips):
        error = np.zeros_like(window.inputs)
        error[jump] = window.slips[jump]
        yield error
    length = limits.SAMPLES_OF_NOISE
    for column in np.flatnonzero(window.noise).tolist():
        for first in range(0, len(window.time), length):
            error = np.zeros_like(window.inputs)
            error[first : first + length, column] = window.noise[column] / np.sqrt(length)
            yield error


def jumps_of(slips: Array) -> list[tuple[int, int]]:
    """Samples and inputs, by number, of jumps: the few changes that are most of what an input
    changes. What changes all the time has none: there the moments average out."""
    found, most = list[tuple[int, int]](), len(slips) // limits.SAMPLES_A_JUMP
    for column, own in enumerate((slips**2).T):
        order = np.argsort(-own, kind="stable")
        share = np.cumsum(own[order])
        count = 1 + int(np.searchsorted(share, limits.MOST_OF_ALL * share[-1]))
        if share[-1] > 0.0 and count <= most:
            found += [(sample, column) for sample in order[:count].tolist()]
    return found


def _inside(signal: SignalSpec, values: Array) -> Array:
    """Readings without glitches or values at the ends of the range, which may hide larger ones."""
    if not np.isfinite(values).any():
        return values
    low, high = signal.ends
    with np.errstate(invalid="ignore"):
        return np.where((values > low) & (values < high), without_glitches(values)[0], np.nan)


def _table(columns: Iterable[Array], count: int) -> Array:
    """Columns side by side, shape (count, columns), also if there are none."""
    return np.ascontiguousarray(np.array([*columns]).reshape(-1, count).T)


def _without_gaps(table: Array) -> Array:
    return _table(map(filled, table.T), len(table))


def _firsts(count: int, length: int) -> list[int]:
    """First samples of windows that overlap by half; they fill the piece."""
    number = 1 + int(np.ceil(2 * max(count - length, 0) / length))
    firsts: list[int] = np.linspace(0, max(count - length, 0), number).astype(int).tolist()
    return firsts


def _window(dynamics: Dynamics, piece: Window, number: int, rows: slice, averaged: bool) -> Window:
    inputs, measured = piece.inputs[rows], piece.measured[rows]
    assert piece.slips is not None
    slips = piece.slips[rows]
    window = replace(
        piece,
        time=piece.time[rows],
        inputs=inputs,
        measured=measured,
        slips=slips,
        bent=bent_by(slips) if averaged else None,
        piece=number,
        first=rows.start,
    )
    given = np.isfinite(inputs).mean(axis=0) >= limits.WINDOW_COMPLETE
    because = [
        f"{n} has no reading" for n, there in zip(dynamics.inputs, given, strict=True) if not there
    ]
    if not (window.completeness >= limits.WINDOW_COMPLETE).any():
        some = zip(dynamics.outputs, piece.completeness > 0.0, strict=True)
        names = [name for name, there in some if there] or dynamics.outputs
        because.append(NO_READING.format(" and ".join(names)))
    if because:
        return replace(window, because="; ".join(because))
    return replace(window, inputs=_without_gaps(inputs))


def _noise(ruleset: Ruleset, dynamics: Dynamics, pieces: Sequence[Window]) -> tuple[Array, Array]:
    """White noise from third differences, at least the resolution, and median of each output."""
    noise, level = np.ones(len(dynamics.outputs)), np.zeros(len(dynamics.outputs))
    for i, name in enumerate(dynamics.outputs):
        columns = [piece.measured[:, i] for piece in pieces]
        values = np.concatenate([*columns, np.zeros(0)])
        if np.isfinite(values).any():
            third = np.concatenate([np.diff(column, 3) for column in columns])
            level[i] = float(np.nanmedian(values))
            signal = ruleset.signal_by_id[name]
            least = common.NO_CHANGE * float(systematic_u(signal, level[i]))
            white = white_noise(third[np.isfinite(third)], 3)
            noise[i] = max(white, resolution(values, signal), least)
    return noise, level
