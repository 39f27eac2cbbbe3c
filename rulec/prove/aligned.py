"""A predicted reading over time, and the columns that may explain its residual."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rulec.prove.limits import CHUNKS, FEWEST_IN_A_COURSE, FOLDS, LAGS, SAME

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

TIME = "time [s]"


@dataclass(frozen=True)
class Course:
    """A predicted signal; arrays of shape (n,), NaN where there is no value.

    `heldout` flags samples that may not be used for learning.
    """

    signal: str
    time: Array
    heldout: NDArray[np.bool_]
    measured: Array
    recalibrated: Array

    @property
    def residual(self) -> Array:
        """Measured minus recalibrated."""
        return self.measured - self.recalibrated

    @property
    def learnt(self) -> NDArray[np.bool_]:
        """Training samples."""
        flags: NDArray[np.bool_] = np.isfinite(self.residual) & ~self.heldout
        return flags

    @property
    def judged(self) -> NDArray[np.bool_]:
        """Samples that are held out and can be compared."""
        flags: NDArray[np.bool_] = np.isfinite(self.residual) & self.heldout
        return flags

    @property
    def folds(self) -> NDArray[np.intp]:
        """Fold of each sample, in successive blocks; -1 for samples that are not used."""
        learnt = self.learnt
        rank = np.cumsum(learnt) - 1
        chunk = rank * CHUNKS // max(int(learnt.sum()), 1)
        return np.where(learnt, chunk % FOLDS, -1)


def columns_of(text: str) -> dict[str, Array]:
    """Read a CSV table as columns by header; NaN in cells without a number."""
    head, *rows = csv.reader(io.StringIO(text))
    return {
        name: np.array([_number(row[i]) for row in rows], dtype=float)
        for i, name in enumerate(head)
    }


def courses_of(text: str) -> list[Course]:
    """Read the courses in a file of `rulec mismatch --series`."""
    table = columns_of(text)
    named = {header.rpartition(" [")[0]: values for header, values in table.items()}
    signals = [n.removesuffix(" measured") for n in named if n.endswith(" measured")]
    return [
        Course(
            signal=signal,
            time=named["time"],
            heldout=named["heldout"] == 1,
            measured=named[f"{signal} measured"],
            recalibrated=named[f"{signal} recalibrated"],
        )
        for signal in signals
    ]


def drivers_of(columns: Columns, course: Course, own: Sequence[str] = ()) -> dict[str, Array]:
    """Return the columns at the times of the course, without that of the predicted signal.

    That one is recognised by its name (`own` if the plant has another one) or its values.
    """
    aligned = at_times(columns, course.time)
    return {
        header: values
        for header, values in aligned.items()
        if header not in own
        and header.rpartition(" [")[0] != course.signal
        and not _same(values, course)
        and np.isfinite(values[course.learnt]).any()
        and np.nanstd(values[course.learnt]) > 0
    }


def at_times(columns: Columns, time: Array) -> dict[str, Array]:
    """Resample columns at other times: the mean of the samples that belong to each.

    A sample belongs to the nearest time if it is nearer than half the usual interval.
    """
    raw = columns[TIME]
    if len(raw) == len(time) and np.allclose(raw, time, rtol=1e-8):
        return {header: np.asarray(values) for header, values in columns.items()}
    nearest = np.searchsorted((time[1:] + time[:-1]) / 2, raw)
    reach = np.median(np.diff(time)) / 2 if len(time) > 1 else np.inf
    near = np.abs(raw - time[nearest]) <= reach * (1 + 1e-9)
    return {header: _means(raw, values, time, nearest, near) for header, values in columns.items()}


def lagged(columns: Columns) -> dict[str, Array]:
    """Delay columns by LAGS; before the first sample they have its value."""
    return {
        f"{header} {lag} ago": values[np.maximum(np.arange(len(values)) - lag, 0)]
        for header, values in columns.items()
        for lag in LAGS
    }


def rms(values: Array) -> float:
    """Return the root mean square; NaN of no values."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _means(
    raw: Array, values: Array, time: Array, nearest: NDArray[np.intp], near: NDArray[np.bool_]
) -> Array:
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(time), np.nan)
    used = known & near
    count = np.bincount(nearest[used], minlength=len(time))
    total = np.bincount(nearest[used], weights=values[used], minlength=len(time))
    between = np.interp(time, raw[known], values[known])
    return np.where(count > 0, total / np.maximum(count, 1), between)


def _same(values: Array, course: Course) -> bool:
    """Whether a column is the predicted reading, by samples that are not held out."""
    both = course.learnt & np.isfinite(values)
    own = course.measured[both]
    return bool(both.any()) and rms(values[both] - own) <= SAME * rms(own)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def likeness(time: Array, course: Array, clock: Array, driver: Array) -> float:
    """Return the absolute correlation of a reconstructed course with the truth; 0 without one.

    `time` and `course` have shape (n,), `clock` and `driver` shape (m,).
    """
    usable = np.isfinite(course)
    truth = np.interp(time[usable], clock, driver)
    if usable.sum() < FEWEST_IN_A_COURSE or np.std(course[usable]) == 0 or np.std(truth) == 0:
        return 0.0
    return float(abs(np.corrcoef(course[usable], truth)[0, 1]))
