"""Columns from a logger whose clock is ahead or behind by a constant time.

A clock shifts a whole column. A plant or a sensor with a lag begins to move with the others but
moves more slowly. So a shift must explain the changes, and far better than a lag does. A dead time
of a sensor also shifts its whole column, and cannot be distinguished from a clock.

Source: own derivation.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.points import points_of_samples
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches
from rulec_runtime.report.text import listed
from scipy.special import expit

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.model import ESTIMATION
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.hypotheses import CLOCK, AcceptedHypothesis, Hypothesis

# How well every sample agrees, including those in which a settled plant changes its state.
#
# A column with a wrong clock agrees while everything is constant, and contradicts the others
# around each change: in samples that the search for physics leaves out. Liquids follow within
# milliseconds, so apart from lags every sample is an operating point of its own.


@dataclass(frozen=True)
class Moving:
    """Samples of a recording, judged by a model that was fitted to its settled points.

    `chosen`, shape (n,), are numbers of samples: all, or evenly spaced ones.
    """

    recording: Recording
    rows: Rows
    setting: Configuration
    chosen: NDArray[np.intp]

    @cached_property
    def recorded(self) -> Array:
        """Errors as recorded, shape (rows,), in units of their noise."""
        return self.errors({})

    def errors(self, columns: Mapping[str, Array]) -> Array:
        """Errors with some columns replaced, each shape (samples of the recording,), SI."""
        at = {name: values[self.chosen] for name, values in columns.items()}
        return self.rows.errors(self.rows.system.flows(self.setting, at=at))[0]

    @cached_property
    def slopes(self) -> dict[str, Array]:
        """Slopes of errors by each reading, shape (rows,), per SI."""
        flows = self.rows.system.flows(self.setting)
        maps = self.rows.maps(flows)
        return {name: self.rows.column(maps, by) for name, by in flows.by_reading.items()}

    def excess(self, errors: Array) -> Array:
        """Log of a sample's deviation in noise, shape (n,); NaN if nothing is compared."""
        square, count = (
            np.bincount(self.rows.point, values, minlength=len(self.chosen))
            for values in (errors**2, np.ones(len(errors)))
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            log: Array = 0.5 * np.log(np.maximum(square / count, 1.0))
        return log


def moving_of(
    recording: Recording, data: Data, system: System, setting: Configuration
) -> Moving | None:
    """Samples of a recording in addition to its settled points; None if nothing checks them."""
    n = len(recording)
    chosen = np.arange(0, n, -(-n // limits.MOVING_SAMPLES))
    lengths = np.sqrt(data.stretches.lengths)
    noise = {name: float(np.median(v * lengths)) for name, v in data.noise.items()}
    samples = Data(
        points=points_of_samples(recording, system.ruleset, noise).at(chosen),
        time=recording.time[chosen],
        noise={k: np.full(len(chosen), v) for k, v in noise.items()},
        block=np.zeros(len(chosen), dtype=np.intp),
        part=np.full(len(chosen), ESTIMATION),
        of_rows=False,
        split="",
        digest="",
        moving={},
        stretches=Stretches(chosen, chosen + 1),
        sample=np.zeros(0, dtype=np.intp),
        source=np.zeros(len(chosen), np.intp)
        if recording.source is None
        else recording.source[chosen],
        sources=recording.sources,
        clock=recording.time[chosen] - recording.time[0],
        timed=True,
    )
    rows = rows_of(System(system.ruleset, system.builder, samples), setting)
    return Moving(recording, rows, setting, chosen) if rows.groups else None


@dataclass(frozen=True, kw_only=True)
class Shift:
    """Columns with one clock, `by` samples late (negative: early).

    `gain` is over the recording as it is, `lag` the gain of a lag instead, nats; `left` is the
    remaining share of the disagreement, in logs of its size.
    """

    signals: tuple[str, ...]
    by: int
    gain: float = 0.0
    lag: float = 0.0
    left: float = 1.0

    def odds(self, tried: int) -> float:
        """Log odds against the recording as it is and against a lag, of so many shifts tried."""
        price = limits.STRUCTURE_ODDS - float(np.log(tried))
        return self.gain + price - float(np.logaddexp(0.0, self.lag + price))


def shifts_of(moving: Moving) -> tuple[list[Shift], int]:
    """Shifts that explain the samples, best first, and the number tried."""
    tried = [sign * by for by in sizes_of(moving.recording) for sign in (1, -1)]
    scanned = [(_scanned(moving, unit, by), unit, by) for unit in _units(moving) for by in tried]
    best: dict[tuple[str, ...], tuple[float, int]] = {}
    for gain, unit, by in scanned:
        if gain > best.get(unit, (0.0, 0))[0]:
            best[unit] = gain, by
    order = sorted(best, key=lambda unit: -best[unit][0])[: limits.STRUCTURE_REFITTED]
    found = [_judged(moving, _refined(moving, unit, best[unit][1])) for unit in order]
    return sorted(found, key=lambda s: -s.gain), len(scanned)


def _units(moving: Moving) -> Iterator[tuple[str, ...]]:
    """Columns that may share a clock: each alone, and those of a module together."""
    modules: dict[str, list[str]] = {}
    for name in moving.slopes:
        yield (name,)
        modules.setdefault(name.partition(".")[0], []).append(name)
    if len(modules) > 1:
        yield from (tuple(names) for names in modules.values() if len(names) > 1)


def sizes_of(recording: Recording) -> list[int]:
    """Sizes of shifts to try first, in samples."""
    return [by for by in limits.CLOCK_SHIFTS if by <= longest(recording)]


def longest(recording: Recording) -> float:
    """The longest shift of a column, in samples."""
    return len(recording) * limits.LATEST


def _change(moving: Moving, unit: Sequence[str], by: int) -> Array:
    """The change of errors if columns are read `by` samples later, to first order."""
    change = np.zeros(len(moving.rows))
    for name in unit:
        off = later(moving.recording, name, by) - moving.recording.values[name]
        change += moving.slopes[name] * off[moving.chosen][moving.rows.point]
    return change


def _scanned(moving: Moving, unit: Sequence[str], by: int) -> float:
    """The gain of a shift to first order, over all samples."""
    there = moving.excess(moving.recorded + _change(moving, unit, by))
    return float(np.nansum(moving.excess(moving.recorded) - there))


def later(recording: Recording, name: str, by: int) -> Array:
    """A column read `by` samples later, shape (n,); NaN beyond the ends of its file."""
    values, n = recording.values[name], len(recording)
    at = np.arange(n) + by
    inside = (at >= 0) & (at < n)
    at = np.clip(at, 0, n - 1)
    return np.where(inside & (recording.segment[at] == recording.segment), values[at], np.nan)


def _read(moving: Moving, unit: Sequence[str], by: int) -> Array:
    """Deviations of samples in noise, in logs, with columns read `by` samples later."""
    columns = {name: later(moving.recording, name, by) for name in unit}
    return moving.excess(moving.errors(columns))


def _refined(moving: Moving, unit: tuple[str, ...], by: int) -> Shift:
    """The best shift near one that was tried."""
    plain = moving.excess(moving.recorded)

    def gain(at: int) -> float:
        return float(np.nansum(plain - _read(moving, unit, at)))

    return Shift(signals=unit, by=nearest(gain, by, longest(moving.recording)))


def nearest(gain: Callable[[int], float], by: int, most: float) -> int:
    """The shift near `by` with the largest gain, by ever smaller steps; at most `most` samples."""
    known = {0: 0.0}
    step = max(abs(by) // 4, 1)
    while step:
        for at in (by - step, by, by + step):
            if at not in known:
                known[at] = gain(at) if abs(at) <= most else -np.inf
        near = max((by, by - step, by + step), key=lambda at: known[at])
        by, step = near, step if near != by else step // 2
    return by


def _judged(moving: Moving, shift: Shift) -> Shift:
    """The gain of a shift, and of a lag instead, where reading otherwise makes a difference;
    samples of one change count as one comparison."""
    if not shift.by:
        return shift
    plain, there = moving.excess(moving.recorded), _read(moving, shift.signals, shift.by)
    change = _change(moving, shift.signals, shift.by)
    size = np.sqrt(np.bincount(moving.rows.point, change**2, minlength=len(plain)))
    moved = (size > limits.GROSSLY_OFF) & np.isfinite(plain) & np.isfinite(there)
    if not moved.any() or plain[moved].mean() <= 0.0:
        return Shift(signals=shift.signals, by=shift.by)
    lags = [moving.excess(moving.errors(c)) for c in _lagging(moving, shift)]
    slow = min(float(np.mean(np.where(np.isfinite(v), v, plain)[moved])) for v in lags)
    # Changes are runs of samples, cut at the ends of blocks.
    block = np.arange(len(moved)) * common.BLOCKS // len(moved)
    first = moved & ~(np.concatenate([[False], moved[:-1]]) & (np.diff(block, prepend=-1) == 0))
    count = int(first.sum())
    return Shift(
        signals=shift.signals,
        by=shift.by,
        gain=count * float(plain[moved].mean() - there[moved].mean()),
        lag=count * float(plain[moved].mean() - slow),
        left=float(there[moved].mean() / plain[moved].mean()),
    )


def _lagging(moving: Moving, shift: Shift) -> Iterator[Mapping[str, Array]]:
    """Columns as they are if a lag causes what looks like a shift. If a column is late, all others
    are slowed down alike; if it is early, the column itself is."""
    slow = set(shift.signals)
    if shift.by > 0:
        slow = set(moving.slopes) - slow
    for share in limits.LAG_SHARES:
        pace = share * abs(shift.by)
        yield {name: _lagged(moving.recording, name, pace) for name in slow}


def _lagged(recording: Recording, name: str, pace: float) -> Array:
    """A column behind a first-order lag of `pace` samples, shape (n,)."""
    values, left = recording.values[name].copy(), float(np.exp(-1.0 / pace))
    new = np.diff(recording.segment, prepend=recording.segment[:1]) != 0
    for i in range(1, len(values)):
        if not new[i] and np.isfinite(values[i - 1]):
            values[i] += left * (values[i - 1] - values[i])
    return values


def taken_of(
    shifts: Sequence[Shift],
    tried: int,
    recording: Recording,
    ruleset: Ruleset,
    leaves: float = limits.CLOCK_LEAVES,
) -> AcceptedHypothesis | None:
    """The best shift, if it is certain and leaves little; with others that explain as much."""
    sound = [s for s in shifts if s.by and s.left < leaves]
    best = max(sound, key=lambda s: s.odds(tried), default=None)
    if best is None or float(expit(best.odds(tried))) <= common.CERTAIN:
        return None
    near = best.odds(tried) - float(np.log(common.CERTAIN / (1.0 - common.CERTAIN)))
    alike = [s for s in sound if s is not best and s.odds(tried) > near]
    hypothesis = hypothesis_of(best, alike, pace_of(recording), ruleset)
    return AcceptedHypothesis(hypothesis, best.gain, float(expit(best.odds(tried))))


def pace_of(recording: Recording) -> float:
    """Usual time between rows, s."""
    return float(np.median(np.diff(recording.time))) if len(recording) > 1 else 0.0


def hypothesis_of(
    shift: Shift, alike: Sequence[Shift], pace: float, ruleset: Ruleset
) -> Hypothesis:
    """A shift in words, with `pace` s per sample; `alike` are others that explain as much."""
    late, names = shift.by * pace, listed(list(shift.signals))
    text = " or ".join(_in_words(one, pace) for one in (shift, *alike))
    inputs = all(ruleset.signal_by_id[name].is_input for name in shift.signals)
    same = ""
    if late > 0.0 and not inputs:
        same = " (a dead time of the sensor, or of its way to the recorder, looks the same)"
    elif late < 0.0 and inputs:
        same = " (a plant that answers it so much later looks the same)"
    return Hypothesis(
        kind=CLOCK,
        mending=Mending(signals=shift.signals, late=late),
        text=text + same,
        action=f"set the clock that {names} {'is' if len(shift.signals) == 1 else 'are'} recorded "
        f"by {'back' if late > 0.0 else 'forward'} by {abs(late):.4g} s, or shift what it wrote",
    )


def _in_words(shift: Shift, pace: float) -> str:
    verb = "is" if len(shift.signals) == 1 else "are"
    side = "late" if shift.by > 0 else "early"
    return (
        f"{listed(list(shift.signals))} {verb} recorded {abs(shift.by) * pace:.4g} s too {side} "
        "against the others"
    )
