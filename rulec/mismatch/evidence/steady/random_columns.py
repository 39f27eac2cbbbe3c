"""Random columns at settled points: errors of form, held inputs, and sensors that move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import DisturbanceLocation
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.operating_state_means import likeness
from rulec.mismatch.evidence.steady.screen import change_by, spot_column
from rulec.mismatch.evidence.term import bends

# Errors of form: no law, whether of the plant or of an effect, obeys its formula exactly.


def errors_of_form(
    plain: Fitted, seen: NDArray[np.bool_], laws: Sequence[DisturbanceLocation]
) -> tuple[Array, tuple[str, ...]]:
    """Rows of errors of form, shape (rows, errors), and the law of each.

    Each law has its own errors, as large as its accuracy. Two meters in one line share no law: no
    error of form explains a difference between them. Rows that count are flagged in `seen`.
    """
    rows, system = plain.rows, plain.rows.system
    flows = system.flows(Configuration())
    columns, law = [np.zeros((int(seen.sum()), 0))], []
    ways: dict[str, Array] = {}
    for spot in laws:
        column = spot_column(plain, spot)
        if column is None:
            continue
        if spot.module not in ways:
            alike = likeness(system, flows, spot.module)
            ways[spot.module] = _smooth_over(alike, limits.FORM_RANK)
        u = common.FORM_U * spot.accuracy * np.nan_to_num(system.value_of(spot))
        whole = column * u[rows.point]
        own = _shown((whole[:, None] * ways[spot.module][rows.point])[seen], common.FORM_KNOWN)
        columns.append(own)
        law += [spot.id] * own.shape[1]
    return np.concatenate(columns, axis=1), tuple(law)


def errors_of_effects(now: Fitted, seen: NDArray[np.bool_]) -> Array:
    """Each effect's own term times smooth functions of its drivers, shape (rows, functions).

    The driver of a growing fault is its growth so far, as it need not grow linearly. Drivers take
    the values that the model predicts: functions of a reading would explain the noise of that
    reading.
    """
    rows, setting = now.rows, now.setting
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
        term = change_by(now, candidate)
        for shape in shapes:
            column = rows.column(now.maps, {i: v * shape for i, v in term.items()})
            columns.append(column[seen])
    return np.stack(columns, axis=1) if columns else np.zeros((int(seen.sum()), 0))


def _shapes(driver: Array | float) -> Sequence[Array]:
    values = np.asarray(driver, dtype=float)
    return bends(np.nan_to_num(values, nan=float(np.nanmedian(values))))


# Errors of sensors: slow ones within their class, and those of inputs that are held.


def moving_sensors(plain: Fitted, seen: NDArray[np.bool_]) -> Array:
    """Rows of sensor errors that move slowly within their class, shape (rows, errors)."""
    rows, system = plain.rows, plain.rows.system
    lasting = {ERROR + name for name in system.shared}
    errors = [i for i, name in enumerate(plain.prior.names) if name in lasting]
    if not (system.data.timed and errors):
        return np.zeros((int(seen.sum()), 0))
    course = _smooth_in_time(system.data.time, system.data.source)[rows.point[seen]]
    tables = [plain.jacobian[seen][:, [i]] * course for i in errors]
    return _shown(np.concatenate(tables, axis=1), common.MOVING_SHARES[-1])


def held_inputs(plain: Fitted, seen: NDArray[np.bool_]) -> Array:
    """Rows of the errors of inputs that are held over several points, shape (rows, errors)."""
    rows, data = plain.rows, plain.rows.system.data
    flows = rows.system.flows(Configuration())
    columns = [np.zeros((len(rows), 0))]
    for name, slopes in flows.by_reading.items():
        values = data.values[name]
        visit = np.cumsum(np.abs(np.diff(values, prepend=np.nan)) > 1e-9 * np.abs(values))
        longer = np.flatnonzero(np.bincount(visit) > 1)
        if len(longer):
            noise = np.nan_to_num(data.noise[name][rows.point])
            shown = rows.column(plain.maps, slopes) * noise
            columns.append(shown[:, None] * (visit[rows.point, None] == longer))
    return np.asarray(np.concatenate(columns, axis=1)[seen])


def _shown(table: Array, times: float) -> Array:
    """The fewest columns with the same sum of squares, without those that do not show at `times`
    their size."""
    left, size, _ = np.linalg.svd(table, full_matrices=False)
    kept = size * times > limits.FORM_NOT_SEEN
    return np.asarray(left[:, kept] * size[kept])


def _smooth_over(correlation: Array, least: float) -> Array:
    """Independent functions, shape (n, functions), whose sum has the given correlation, shape (n,
    n). Those below a share `least` of the largest variance are omitted."""
    size, ways = np.linalg.eigh(correlation)
    kept = size > least * size.max()
    return np.asarray(ways[:, kept] * np.sqrt(size[kept]))


def _smooth_in_time(time: Array, source: NDArray[np.intp]) -> Array:
    """Independent smooth courses of unit total variance, own ones for each recording, shape (n,
    courses)."""
    found = []
    for own in np.unique(source):
        here = np.flatnonzero(source == own)
        phase = (time[here] - time[here[0]]) / max(float(np.ptp(time[here])), 1e-300)
        alike = np.exp(-0.5 * ((phase[:, None] - phase[None, :]) / common.FORM_LENGTH) ** 2)
        smooth = _smooth_over(alike, limits.MOVING_RANK)
        whole = np.zeros((len(time), smooth.shape[1]))
        whole[here] = smooth
        found.append(whole)
    return np.concatenate(found, axis=1)
