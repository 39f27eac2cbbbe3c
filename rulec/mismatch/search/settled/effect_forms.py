"""Errors of form of the effects' own laws: no effect obeys its formula exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.stores.effect_forms import bends


def forms_of_effects(rows: Rows, seen: NDArray[np.bool_], now: Fitted) -> Array:
    """Each effect's own term times smooth functions of its drivers, shape (rows, functions).

    The driver of a growing fault is its growth so far, as it need not grow linearly. Drivers take
    the values that the model predicts: functions of a reading would explain the noise of that
    reading.
    """
    setting = now.setting
    values = {**rows.system.inputs, **now.predicted}
    columns = []
    for candidate in setting.joined:
        drivers = [values[n] for n in dict.fromkeys(candidate.drivers.values())]
        if candidate.sort == "fault":
            own = {u.id for u in candidate.unknowns}
            courses = (c for c in setting.courses if c.unknown in own)
            drivers = [c.risen for c in courses if c.risen is not None]
        shapes = [shape for driver in drivers for shape in _shapes(driver)]
        if not shapes or all(u.null is None or u.fixed for u in candidate.unknowns):
            continue
        term = _term(now, candidate)
        for shape in shapes:
            column = rows.column(now.maps, {i: v * shape for i, v in term.items()})
            columns.append(column[seen])
    return np.stack(columns, axis=1) if columns else np.zeros((int(seen.sum()), 0))


def _term(now: Fitted, candidate: Candidate) -> dict[int, Array]:
    """Change of each estimate by a candidate, shape (n,), m3/s, by number of the observer."""
    system, setting = now.rows.system, now.setting
    modules = system.reached(candidate.observers)
    there, plain = (
        system.flows(s, at=now.predicted, modules=modules).values
        for s in (setting, setting.leaving(candidate.id))
    )
    return {i: np.nan_to_num(v) for i, v in enumerate(there - plain) if np.any(np.nan_to_num(v))}


def _shapes(driver: Array | float) -> Sequence[Array]:
    values = np.asarray(driver, dtype=float)
    return bends(np.nan_to_num(values, nan=float(np.nanmedian(values))))
