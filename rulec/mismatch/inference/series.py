"""Predictions of the three models as a table, and the spans of time that were held out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec
from rulec_runtime.output.csv_cell import row_of

from rulec.mismatch.result import Course, Series

MODELS = ("shipped", "recalibrated", "repaired")


class Predicted(NamedTuple):
    """Predictions of the models, SI, shape (n,) each."""

    shipped: Array
    recalibrated: Array
    repaired: Array


def course_of(signal: SignalSpec, measured: Array, predicted: Predicted) -> Course:
    """Reading and predictions, given in SI, shape (n,), in the unit of the signal."""
    arrays = {"measured": measured, **predicted._asdict()}
    shown = {name: (values - signal.offset) / signal.factor for name, values in arrays.items()}
    return Course(signal=signal.id, unit=signal.unit, **shown)


def series_csv(series: Series | None) -> str:
    """A row per sample; a cell is empty without a reading or prediction."""
    if series is None:
        return "time [s],heldout [1]\n"
    head = ["time [s]", "heldout [1]"]
    columns = [
        [f"{time:.10g}" for time in series.time],
        ["1" if flag else "0" for flag in series.heldout],
    ]
    for course in series.courses:
        for name in ("measured", *MODELS):
            head.append(f"{course.signal} {name} [{course.unit}]")
            values = getattr(course, name)
            columns.append([f"{v:.9g}" if math.isfinite(v) else "" for v in values])
    return "\n".join([row_of(head), *map(",".join, zip(*columns, strict=True))]) + "\n"


def heldout_spans(time: Array, heldout: Sequence[bool] | np.ndarray) -> list[tuple[float, float]]:
    """Spans of time, s, that contain exactly the held-out samples; both shape (n,).

    They end midway to the neighbours, as a sample may be a mean over some time around it.

    >>> heldout_spans(np.array([0.0, 1.0, 2.0, 3.0, 4.0]), [False, True, True, False, True])
    [(0.5, 2.5), (3.5, 4.5)]
    """
    flags = np.asarray(heldout, dtype=bool)
    if not flags.any():
        return []
    middles = (time[1:] + time[:-1]) / 2
    first = 2 * time[0] - middles[0] if len(middles) else time[0]
    last = 2 * time[-1] - middles[-1] if len(middles) else time[-1]
    edges = np.concatenate([[first], middles, [last]])
    turns = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(float(edges[a]), float(edges[b])) for a, b in turns.reshape(-1, 2)]
