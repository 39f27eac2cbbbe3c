"""Columns from a logger whose clock is ahead or behind by a constant time.

A clock shifts a whole column. A plant or a sensor with a lag begins to move with the others but
moves more slowly. So a shift must explain the changes, and far better than a lag does. A dead time
of a sensor also shifts its whole column, and cannot be distinguished from a clock.

Source: own derivation.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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

    def _errors(self, columns: Mapping[str, Array]) -> Array:
        """Errors with some columns replaced, each shape (samples of the recording,), SI; shape
        (rows,), in units of their noise."""
        at = {name: values[self.chosen] for name, values in columns.items()}
        return self.rows.errors(self.rows.system.flows(self.setting, at=at))[0]

    def excess(self, columns: Mapping[str, Array]) -> Array:
        """Log of each sample's deviation in noise with some columns replaced, shape (n,); NaN if
        nothing is compared."""
        return self._excess(self._errors(columns))

    @cached_property
    def recorded(self) -> tuple[Array, Array]:
        """Errors as recorded, shape (rows,), and the deviations of samples, shape (n,)."""
        errors = self._errors({})
        return errors, self._excess(errors)

    @cached_property
    def slopes(self) -> dict[str, Array]:
        """Slopes of errors by each reading, shape (rows,), per SI."""
        flows = self.rows.system.flows(self.setting)
        maps = self.rows.maps(flows)
        return {name: self.rows.column(maps, by) for name, by in flows.by_reading.items()}

    def changed(self, unit: Sequence[str], by: int) -> tuple[Array, Array]:
        """The change of errors if columns are read `by` samples later, to first order, shape
        (rows,), and the deviations of samples then, shape (n,)."""
        change = np.zeros(len(self.rows))
        for name, there in self.later(unit, by).items():
            off = there - self.recording.values[name]
            change += self.slopes[name] * off[self.chosen][self.rows.point]
        return change, self._excess(self.recorded[0] + change)

    def later(self, unit: Sequence[str], by: int) -> dict[str, Array]:
        """Columns read `by` samples later, each shape (samples of the recording,); NaN beyond the
        ends of their file."""
        segment = self.recording.segment
        at = np.arange(len(segment)) + by
        near = np.clip(at, 0, len(segment) - 1)
        inside = (at == near) & (segment[near] == segment)
        return {n: np.where(inside, self.recording.values[n][near], np.nan) for n in unit}

    def _excess(self, errors: Array) -> Array:
        square, count = (
            np.bincount(self.rows.point, values, minlength=len(self.chosen))
            for values in (errors**2, np.ones(len(errors)))
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            log: Array = 0.5 * np.log(np.maximum(square / count, 1.0))
        return log


def moving_of(recording: Recording, system: System, setting: Configuration) -> Moving | None:
    """Samples of a recording in addition to its settled points; None if nothing checks them."""
    n, data = len(recording), system.data
    chosen = np.arange(0, n, -(-n // limits.MOVING_SAMPLES))
    lengths, none = np.sqrt(data.stretches.lengths), np.zeros(len(chosen), np.intp)
    noise = {name: float(np.median(v * lengths)) for name, v in data.noise.items()}
    samples = replace(
        data,
        points=points_of_samples(recording, system.ruleset, noise).at(chosen),
        time=recording.time[chosen],
        noise={k: np.full(len(chosen), v) for k, v in noise.items()},
        block=none,
        part=np.full(len(chosen), ESTIMATION),
        moving={},
        stretches=Stretches(chosen, chosen + 1),
        sample=none[:0],
        source=none if recording.source is None else recording.source[chosen],
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
        prior = limits.STRUCTURE_ODDS - float(np.log(tried))
        return self.gain + prior - float(np.logaddexp(0.0, self.lag + prior))


def shifts_of(moving: Moving) -> tuple[list[Shift], int]:
    """Shifts that explain the samples, best first, and the number tried.

    Columns may share a clock: each alone, and those of a module together.
    """
    modules: dict[str, list[str]] = {}
    for name in moving.slopes:
        modules.setdefault(name.partition(".")[0], []).append(name)
    units: list[tuple[str, ...]] = [(name,) for name in moving.slopes]
    units += [tuple(n) for n in modules.values() if 1 < len(n) < len(moving.slopes)]
    sizes = [sign * by for by in sizes_of(moving.recording) for sign in (1, -1)]
    best: dict[tuple[str, ...], tuple[float, int]] = {}
    plain = moving.recorded[1]
    for unit in units if sizes else ():
        gains = [float(np.nansum(plain - moving.changed(unit, by)[1])) for by in sizes]
        if max(gains) > 0.0:
            best[unit] = max(gains), sizes[int(np.argmax(gains))]
    found = []
    for unit in sorted(best, key=lambda unit: -best[unit][0])[: limits.STRUCTURE_REFITTED]:

        def gain(by: int, unit: tuple[str, ...] = unit) -> float:
            return float(np.nansum(plain - moving.excess(moving.later(unit, by))))

        by = nearest(gain, best[unit][1], longest(moving.recording))
        found.append(_judged(moving, unit, by))
    return sorted(found, key=lambda s: -s.gain), len(units) * len(sizes)


def sizes_of(recording: Recording) -> list[int]:
    """Sizes of shifts to try first, in samples."""
    return [by for by in limits.CLOCK_SHIFTS if by <= longest(recording)]


def longest(recording: Recording) -> float:
    """The longest shift of a column, in samples."""
    return len(recording) * limits.LATEST


def nearest(gain: Callable[[int], float], by: int, most: float) -> int:
    """The shift near `by` with the largest gain, by ever smaller steps; at most `most` samples."""
    gains = {0: 0.0}
    step = max(abs(by) // 4, 1)
    while step:
        for at in (by - step, by, by + step):
            if at not in gains:
                gains[at] = gain(at) if abs(at) <= most else -np.inf
        near = max((by, by - step, by + step), key=lambda at: gains[at])
        by, step = near, step if near != by else step // 2
    return by


def _judged(moving: Moving, unit: tuple[str, ...], by: int) -> Shift:
    """The gain of a shift, and of a lag instead, where reading otherwise makes a difference;
    samples of one change count as one comparison."""
    if not by:
        return Shift(signals=unit, by=by)
    plain, there = moving.recorded[1], moving.excess(moving.later(unit, by))
    change = moving.changed(unit, by)[0]
    size = np.sqrt(np.bincount(moving.rows.point, change**2, minlength=len(plain)))
    moved = (size > limits.GROSSLY_OFF) & np.isfinite(plain) & np.isfinite(there)
    if not moved.any() or plain[moved].mean() <= 0.0:
        return Shift(signals=unit, by=by)
    # If a column is late, all others are slowed down alike; if it is early, the column itself is.
    slowed = set(moving.slopes) - set(unit) if by > 0 else set(unit)
    slow = np.inf
    for share in limits.LAG_SHARES:
        pace = share * abs(by)
        lags = moving.excess({name: _lagged(moving.recording, name, pace) for name in slowed})
        slow = min(slow, float(np.mean(np.where(np.isfinite(lags), lags, plain)[moved])))
    # Changes are runs of samples, cut at the ends of blocks.
    block = np.arange(len(moved)) * common.BLOCKS // len(moved)
    first = moved & ~(np.append(False, moved[:-1]) & (np.diff(block, prepend=-1) == 0))
    before, after, count = float(plain[moved].mean()), float(there[moved].mean()), int(first.sum())
    return Shift(
        signals=unit,
        by=by,
        gain=count * (before - after),
        lag=count * (before - slow),
        left=after / before,
    )


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
    pace, texts = pace_of(recording), []
    for shift in (best, *alike):
        verb = "is" if len(shift.signals) == 1 else "are"
        side = "late" if shift.by > 0 else "early"
        texts.append(
            f"{listed(list(shift.signals))} {verb} recorded {abs(shift.by) * pace:.4g} s too "
            f"{side} against the others"
        )
    late, names = best.by * pace, listed(list(best.signals))
    inputs = all(ruleset.signal_by_id[name].is_input for name in best.signals)
    same = ""
    if late > 0.0 and not inputs:
        same = " (a dead time of the sensor, or of its way to the recorder, looks the same)"
    elif late < 0.0 and inputs:
        same = " (a plant that answers it so much later looks the same)"
    hypothesis = Hypothesis(
        kind=CLOCK,
        mending=Mending(signals=best.signals, late=late),
        text=" or ".join(texts) + same,
        action=f"set the clock that {names} {'is' if len(best.signals) == 1 else 'are'} recorded "
        f"by {'back' if late > 0.0 else 'forward'} by {abs(late):.4g} s, or shift what it wrote",
    )
    return AcceptedHypothesis(hypothesis, best.gain, float(expit(best.odds(tried))))


def pace_of(recording: Recording) -> float:
    """Usual time between rows, s."""
    return float(np.median(np.diff(recording.time))) if len(recording) > 1 else 0.0
