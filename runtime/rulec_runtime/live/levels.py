"""Levels of the readings: a row without a change needs no update."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.history import History
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import systematic_u


@dataclass(frozen=True, kw_only=True)
class Levels:
    """Readings as last judged, per signal, all of shape (signals,), SI.

    Attributes
    ----------
    names : the signals.
    low, high : ends of the sensor ranges.
    noise, least : noise of a reading, and the smallest change that counts.
    level, rested : mean of a reading when it was last judged, and over how many rows.
    total, rows : sum and number of the rows since.
    before : the last two rows, shape (2, signals).
    same, lost : number of last rows with an identical reading, and without a usable one.
    """

    names: tuple[str, ...]
    low: Array
    high: Array
    noise: Array
    least: Array
    level: Array
    rested: Array
    total: Array
    rows: Array
    before: Array
    same: Array
    lost: Array

    def after(self, row: Array) -> tuple[Levels, np.ndarray, bool]:
        """Levels after one more row, shape (signals,), which readings have moved, and whether a
        sensor is odd: its reading is stuck, lost, or back."""
        with np.errstate(invalid="ignore"):
            sound = (row >= self.low) & (row <= self.high)
            total, rows = np.where(sound, self.total + row, self.total), self.rows + sound
            moved = self._off(row, 1.0)
            moved |= self._off((row + self.before.sum(axis=0)) / 3.0, 3.0)
            moved |= self._off(total / np.maximum(rows, 1.0), np.maximum(rows, 1.0))
        moved &= sound
        moved |= sound != (self.lost == 0.0)
        same = np.where(row == self.before[-1], self.same + 1.0, 0.0)
        lost = np.where(sound, 0.0, self.lost + 1.0)
        odd = _turns(self.same, same, limits.STANDS_STILL)
        odd |= _turns(self.lost, lost, float(common.PERSISTENCE))
        long = rows >= common.LONGEST_STRETCH
        now = replace(
            self,
            total=np.where(long, 0.0, total),
            rows=np.where(long, 0.0, rows),
            before=np.stack([self.before[-1], row]),
            same=same,
            lost=lost,
        )
        return now, moved, bool(odd.any())

    def after_rows(self, recent: Recording, new: int) -> tuple[Levels, np.ndarray, bool]:
        """The same after the `new` last rows of a recording."""
        levels, moved, odd = self, np.zeros(len(self.names), dtype=bool), False
        table = np.array([recent.values[name][len(recent) - new :] for name in self.names])
        for row in table.T:
            levels, some, odd_now = levels.after(row)
            moved |= some
            odd |= odd_now
        return levels, moved, odd

    def judged(self, history: History) -> Levels:
        """Levels after the signals of a history have been judged at its last operating point."""
        values = history.points.values
        level = np.array([values[n][-1] if n in values else np.nan for n in self.names])
        known = np.isfinite(level)
        return replace(
            self,
            level=np.where(known, level, self.level),
            rested=np.where(known, float(history.timeline.samples[-1]), self.rested),
            total=np.where(known, 0.0, self.total),
            rows=np.where(known, 0.0, self.rows),
        )

    def _off(self, mean: Array, rows: Array | float) -> np.ndarray:
        """Whether the mean of some rows differs from the judged level."""
        spread = limits.MOVED * self.noise * np.sqrt(1.0 / rows + 1.0 / self.rested)
        off: np.ndarray = np.abs(mean - self.level) > np.maximum(spread, self.least)
        return off


def _turns(before: Array, now: Array, enough: float) -> np.ndarray:
    """Whether a count reaches `enough` with this row, or falls back to zero from there."""
    turns: np.ndarray = (now == enough) | ((before >= enough) & (now == 0.0))
    return turns


def levels_of(ruleset: Ruleset, recording: Recording, noise: Mapping[str, float]) -> Levels:
    """The levels in the last rows of a recording."""
    signals = [s for s in ruleset.signals if s.id in recording.values]
    recent = np.array([recording.values[s.id][-common.SHORTEST_STRETCH :] for s in signals])
    with np.errstate(invalid="ignore"):
        level = np.nan_to_num(recent.mean(axis=1))
    slack = [common.BEYOND_RANGE * (s.ends[1] - s.ends[0]) for s in signals]
    wide = [extra if np.isfinite(extra) else 0.0 for extra in slack]
    least = [systematic_u(s, value) for s, value in zip(signals, level, strict=True)]
    none = np.zeros(len(signals))
    return Levels(
        names=tuple(s.id for s in signals),
        low=np.array([s.ends[0] - extra for s, extra in zip(signals, wide, strict=True)]),
        high=np.array([s.ends[1] + extra for s, extra in zip(signals, wide, strict=True)]),
        noise=np.array([noise[s.id] for s in signals]),
        least=common.NO_CHANGE * np.array(least),
        level=level,
        rested=none + recent.shape[1],
        total=none,
        rows=none,
        before=recent[:, -2:].T if recent.shape[1] > 1 else np.tile(recent, 2).T,
        same=none,
        lost=np.where(np.isfinite(recent[:, -1]), 0.0, 1.0),
    )
