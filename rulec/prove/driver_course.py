"""The course of an unrecorded driver, beside the truth."""

from __future__ import annotations

import csv
import io

import numpy as np
from numpy.typing import NDArray

from rulec.prove.limits import FEWEST_IN_A_COURSE

Array = NDArray[np.float64]

TIME = "time [s]"


def columns_of(text: str) -> dict[str, Array]:
    """Read a CSV table as columns by header; NaN in cells without a number."""
    head, *rows = csv.reader(io.StringIO(text))
    return {
        name: np.array([_number(row[i]) for row in rows], dtype=float)
        for i, name in enumerate(head)
    }


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
