"""Compare predictions with readings, periods with labels, courses with a removed column."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.rig.mismatch.case import read_columns

Array = NDArray[np.float64]
Periods = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Hits:
    """How well periods meet labels, both counted in cycles."""

    true: int
    said: int
    both: int

    @property
    def precision(self) -> float:
        """Share of what was said that is true."""
        return self.both / self.said if self.said else float("nan")

    @property
    def recall(self) -> float:
        """Share of what is true that was said."""
        return self.both / self.true if self.true else float("nan")


def hits(periods: Periods, cycles: Mapping[int, bool], length: float, begin: float) -> Hits:
    """Cycles that a period covers for more than half of their loaded part.

    Parameters
    ----------
    cycles : per number whether it is labelled; the label counts as the truth.
    length : of a cycle, s; cycle k begins at k*length.
    begin : second of a cycle from which on it is loaded.
    """
    loaded = length - begin
    said = {
        number
        for number in cycles
        if _overlap(periods, number * length + begin, (number + 1) * length) > loaded / 2
    }
    true = {number for number, label in cycles.items() if label}
    return Hits(len(true), len(said), len(true & said))


def _overlap(periods: Periods, start: float, end: float) -> float:
    return sum(max(0.0, min(end, last) - max(start, first)) for first, last in periods)


def numbers(file: Path, title: str) -> Array:
    """A column; NaN where a cell is empty."""
    cells = (cell for (cell,) in read_columns(file, title))
    return np.array([float(c) if c.strip() else np.nan for c in cells])


def rms(errors: Array) -> float:
    """Root mean square of the finite ones."""
    finite = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else float("nan")


def robust(errors: Array) -> float:
    """Standard deviation by the median of absolute values: outliers do not count."""
    finite = errors[np.isfinite(errors)]
    return float(1.4826 * np.median(np.abs(finite))) if len(finite) else float("nan")


def means(values: Array, groups: Iterable[NDArray[np.intp]]) -> Array:
    """Mean of each group of rows; NaN where a row of it has no value."""
    return np.array([values[group].mean() for group in groups])


def likeness(series: Path, recording: Path, title: str) -> float:
    """Correlation of a reconstructed course with a column that the tool did not see.

    The sign is free: what a driver does is known up to its direction.
    """
    with series.open(encoding="utf-8") as file:
        _, course_title = file.readline().strip().split(",")[:2]
    time, course = numbers(series, "time [s]"), numbers(series, course_title)
    known = np.isfinite(course)
    truth = np.interp(time, numbers(recording, "time [s]"), numbers(recording, title))
    return float(abs(np.corrcoef(course[known], truth[known])[0, 1]))
