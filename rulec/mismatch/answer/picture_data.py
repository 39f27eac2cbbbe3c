"""What the pictures are drawn from: curves without what cannot be drawn, flags, errors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.answer.wording import is_repaired
from rulec.mismatch.result import Curves, Mismatch, Region

WINDOW = 600
"""Samples of a long recording that are drawn one by one."""

BINS = 24
"""Parts of a driver's range of which each has its own median."""

FEWEST = 3
"""Points that a median needs."""

NAME = re.compile(r"[A-Za-z_]\w*")
"""A name in an equation."""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Samples in order of time, shape (n,) each, in the unit of the signal.

    `located` flags the region or the periods in which the mismatch was found, `heldout` what
    nothing was fitted to, `judged` points whose errors count.
    """

    signal: str
    unit: str
    time: Array
    measured: Array
    shipped: Array
    recalibrated: Array
    repaired: Array
    heldout: np.ndarray
    located: np.ndarray
    judged: np.ndarray
    drivers: Mapping[str, Array]

    @property
    def in_unit(self) -> str:
        """The unit in brackets, for an axis."""
        return f" [{self.unit}]" if self.unit not in ("", "1") else ""

    @property
    def is_repaired(self) -> bool:
        """Whether there is a repaired model."""
        return bool(np.isfinite(self.repaired).any())

    @property
    def recalibrated_error(self) -> Array:
        """Measured less recalibrated, shape (n,), NaN where it does not count."""
        return np.where(self.judged, self.measured - self.recalibrated, np.nan)

    @property
    def repaired_error(self) -> Array:
        """Measured less repaired, shape (n,), NaN where it does not count."""
        return np.where(self.judged, self.measured - self.repaired, np.nan)

    def at(self, chosen: slice | np.ndarray) -> Drawn:
        """Some of the samples."""
        arrays: dict[str, Any] = {
            n: v[chosen] for n, v in vars(self).items() if isinstance(v, np.ndarray)
        }
        drivers = {title: readings[chosen] for title, readings in self.drivers.items()}
        return replace(self, **arrays, drivers=drivers)


def curves_of(mismatch: Mismatch) -> Drawn | None:
    """The curves of a comparison; None where there are none to draw."""
    curves, fit = mismatch.curves, mismatch.fit
    if curves is None or not np.isfinite(curves.measured + curves.time).any():
        return None
    repaired = curves.repaired if is_repaired(mismatch) else np.full(len(curves.time), np.nan)
    drawn = Drawn(
        signal=fit.signal if fit is not None else "predicted signal",
        unit=fit.unit if fit is not None else "",
        time=curves.time,
        measured=curves.measured,
        shipped=curves.shipped,
        recalibrated=curves.recalibrated,
        repaired=repaired,
        heldout=np.asarray(curves.heldout, dtype=bool),
        located=_located(mismatch, curves),
        judged=np.asarray(curves.inside, dtype=bool),
        drivers=curves.drivers,
    )
    order = np.argsort(curves.time, kind="stable")
    return drawn.at(order[np.isfinite(curves.time[order])])


def _located(mismatch: Mismatch, curves: Curves) -> np.ndarray:
    """Points in the region of some location or, where it has none, in its periods."""
    located = np.zeros(len(curves.time), dtype=bool)
    readings = {title.partition(" [")[0]: values for title, values in curves.drivers.items()}
    for location in mismatch.locations:
        known = [r for r in location.region if r.variable in readings]
        if known:
            located |= np.all([_within(readings[r.variable], r) for r in known], axis=0)
            continue
        for since, until in location.periods:
            located |= (curves.time >= since) & (curves.time <= until)
    return located


def _within(values: Array, region: Region) -> np.ndarray:
    low = -np.inf if region.low is None else region.low
    high = np.inf if region.high is None else region.high
    result: np.ndarray = (values >= low) & (values <= high)
    return result


def detail_of(drawn: Drawn) -> Drawn:
    """The part of a long recording in which the repair, or else the mismatch, is largest."""
    before = np.nan_to_num(drawn.recalibrated_error) ** 2
    after = np.nan_to_num(drawn.repaired_error) ** 2
    total = np.concatenate([[0.0], np.cumsum(before - after)])
    first = int(np.argmax(total[WINDOW:] - total[:-WINDOW]))
    return drawn.at(slice(first, first + WINDOW))


def middle_by(driver: Array, values: Array) -> tuple[Array, Array]:
    """Median of values in parts of a driver's range: centres and medians, shape (parts,).

    NaN where there are too few values.
    """
    sound = np.isfinite(driver) & np.isfinite(values)
    x, y = driver[sound], values[sound]
    if not len(x) or x.min() == x.max():
        return np.array([]), np.array([])
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, BINS - 1)
    medians = [
        float(np.median(y[place == i])) if (place == i).sum() >= FEWEST else np.nan
        for i in range(BINS)
    ]
    return (edges[:-1] + edges[1:]) / 2, np.array(medians)


def telling_drivers(drawn: Drawn) -> list[str]:
    """Titles of the drivers, first the one over which the error moves most before the repair."""

    def moved(title: str) -> float:
        _, medians = middle_by(drawn.drivers[title], drawn.recalibrated_error)
        return span(medians)

    return sorted(drawn.drivers, key=moved, reverse=True)


def followed_by(mismatch: Mismatch, drawn: Drawn) -> list[str]:
    """Titles of the drivers that the mismatch depends on: those of what has no name, those by whose
    readings it was located, and those in the equations of findings, the most telling first."""
    titles = {title.partition(" [")[0]: title for title in telling_drivers(drawn)}
    shapes = [at.shape.driver for at in mismatch.locations if at.shape is not None]
    regions = [part.variable for at in mismatch.locations for part in at.region]
    equations = {
        f"{f.module}.{word}" for f in mismatch.findings for word in NAME.findall(f.equation)
    }
    found = [*shapes, *regions, *(name for name in titles if name in equations)]
    return [titles[name] for name in dict.fromkeys(found) if name in titles]


def span(values: Array) -> float:
    """Distance from the smallest to the largest known value, shape (n,); 0 without any."""
    sound = values[np.isfinite(values)]
    return float(sound.max() - sound.min()) if len(sound) else 0.0


def rms(values: Array) -> float:
    """Root mean square of what is known, shape (n,); NaN where nothing is."""
    sound = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(sound**2))) if len(sound) else np.nan
