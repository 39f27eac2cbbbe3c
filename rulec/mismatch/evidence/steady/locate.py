"""Locate a mismatch before any effect is named, and the region in which it shows.

Every place in turn gets an error, free at each point. Its share is the part of the residuals that
it explains, beyond what it would explain of noise.

Source: own derivation; the idea of free disturbances per equation is that of Kristensen, Madsen,
Jorgensen 2004, for static relations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import white_noise

from rulec.effects.candidate import DisturbanceLocation
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.system import System


@dataclass(frozen=True)
class Suspect:
    """A place with its error: `course`, shape (n,), SI of its unit, and `share` of the mismatch."""

    spot: DisturbanceLocation
    column: Array
    course: Array
    weight: Array
    share: float


def noise_scale(rows: Rows, residual: Array) -> float:
    """Scatter of neighbouring residuals, shape (rows,), over the expected noise; at least 1."""
    if rows.system.data.of_rows:
        return 1.0
    sizes = []
    for cell in rows.cells:
        table = cell.table(residual).T
        if len(table) > 8:
            sizes.append((len(table), white_noise(np.diff(table, 2, axis=0), 2)))
    if not sizes:
        return 1.0
    counts, spreads = np.array(sizes).T
    return max(1.0, float(np.sqrt(np.average(spreads**2, weights=counts))))


def suspects(fitted: Fitted) -> list[Suspect]:
    """Places by the share of the mismatch that an error there explains, largest first.

    An error may be free at every point or change slowly: a weak one shows only in the second way, a
    fast one only in the first.
    """
    rows = fitted.rows
    system = rows.system
    # Sensors may be better than their class; then the scatter of the residuals counts.
    noise = min(noise_scale(rows, fitted.residual), fitted.scale) ** 2
    open_ = fitted.used[rows.point]
    total = float(np.sum(fitted.residual[open_] ** 2)) - noise * int(open_.sum())
    found = []
    for spot in system.builder.spots:
        column = spot_column(fitted, spot)
        if column is None:
            continue
        suspect = suspect_at(fitted, spot, column)
        known = np.flatnonzero((suspect.weight > 0) & fitted.used)
        course, weight = suspect.course[known], suspect.weight[known]
        gain = max(
            _explained(-course * weight, weight, noise, k) for k in (len(known), limits.SLOW_VALUES)
        )
        found.append((suspect, gain))
    most = max((gain for _, gain in found), default=0.0)
    whole = max(total, most, 1e-300)
    shared = [replace(s, share=float(np.clip(g / whole, 0.0, 1.0))) for s, g in found]
    return sorted(shared, key=lambda s: (-round(s.share, 3), s.spot.id))


def suspect_at(fitted: Fitted, spot: DisturbanceLocation, column: Array) -> Suspect:
    """A place with the error that explains each point best; `column`, shape (rows,), are the slopes
    of the residuals. Its share is left at 0."""
    rows = fitted.rows
    n = len(rows.system.data)
    weight = np.bincount(rows.point, column**2, minlength=n).astype(float)
    moment = np.bincount(rows.point, column * fitted.residual, minlength=n).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        course = np.where(weight > 0, -moment / weight, np.nan)
    return Suspect(spot, column, course, weight, 0.0)


def _explained(moment: Array, weight: Array, noise: float, values: int) -> float:
    """Squares that a course of `values` values explains beyond what it explains of noise."""
    count = min(values, len(moment))
    if count == 0:
        return 0.0
    edges = np.linspace(0, len(moment), count + 1).astype(int)[:-1]
    moments, weights = np.add.reduceat(moment, edges), np.add.reduceat(weight, edges)
    return float(np.sum(moments**2 / weights)) - noise * count


def spot_column(fitted: Fitted, spot: DisturbanceLocation) -> Array | None:
    """Slopes of the residuals by an error at a place, shape (rows,); None where all are 0."""
    system = fitted.rows.system
    if not any(o in system.number for o in spot.observers):
        return None
    modules, at = system.reached(spot.observers), fitted.predicted
    flows = system.flows(fitted.setting, (spot.unknown,), (spot.id,), modules=modules, at=at)
    column = fitted.rows.column(fitted.maps, flows.by_value[spot.unknown])
    return column if np.any(column) else None


def alike(first: Suspect, second: Suspect) -> bool:
    """Do errors at two places have the same signature?"""
    cosine = np.abs(first.column @ second.column)
    cosine /= np.linalg.norm(first.column) * np.linalg.norm(second.column)
    return bool(cosine > common.SAME_PATTERN)


def variables_of(system: System, module: str) -> dict[str, Array]:
    """Readings that may define a region, shape (n,), SI: those of the module, then those that no
    observer needs."""
    known, used = system.ruleset.signal_by_id, {n for o in system.observers for n in o.signals}
    values = {n: v for n, v in system.data.values.items() if n in known}
    own = {n: v for n, v in values.items() if n.partition(".")[0] == module}
    others = {n: v for n, v in values.items() if n not in own and n not in used}
    return {n: v for n, v in {**own, **others}.items() if np.isfinite(v).sum() > 8}
