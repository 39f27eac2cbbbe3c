"""The error of form that an effect's own law has: no effect obeys its formula either."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.stores.effect_forms import bends


def forms_of_effects(rows: Rows, seen: NDArray[np.bool_], now: Fitted) -> Array:
    """Each effect's own term times smooth functions of its drivers, shape (rows, functions).

    What grows does not do so in proportion to time either: its driver is how far it has grown. A
    driver that the model predicts counts as predicted: over a reading, functions would explain that
    reading's own noise.
    """
    setting = now.setting
    values = {**rows.system.inputs, **now.predicted}
    columns = []
    for candidate in setting.joined:
        names = dict.fromkeys(candidate.drivers.values())
        grown, given = _grown(setting, candidate), [values[n] for n in names]
        drivers = grown if candidate.sort == "fault" else given
        null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
        shapes = [shape for driver in drivers for shape in _shapes(driver)]
        if not null or not shapes:
            continue
        term = _term(now, candidate)
        for shape in shapes:
            column = rows.column(now.maps, {i: v * shape for i, v in term.items()})
            columns.append(column[seen])
    return np.stack(columns, axis=1) if columns else np.zeros((int(seen.sum()), 0))


def _term(now: Fitted, candidate: Candidate) -> dict[int, Array]:
    """What a candidate changes, per number of an observer, shape (n,), m3/s."""
    system, setting = now.rows.system, now.setting
    modules = system.reached(candidate.observers)
    there, plain = (
        system.flows(s, at=now.predicted, modules=modules).values
        for s in (setting, setting.leaving(candidate.id))
    )
    return {i: np.nan_to_num(v) for i, v in enumerate(there - plain) if np.any(np.nan_to_num(v))}


def _grown(setting: Configuration, candidate: Candidate) -> list[Array | float]:
    """How far a fault has grown at each point, shape (n,), if it does."""
    own = {u.id for u in candidate.unknowns}
    return [c.risen for c in setting.courses if c.unknown in own and c.risen is not None]


def _shapes(driver: Array | float) -> Sequence[Array]:
    values = np.asarray(driver, dtype=float)
    return bends(np.nan_to_num(values, nan=float(np.nanmedian(values))))
