"""Step 6: errors of the model as shipped, recalibrated and repaired, on points it never saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.configuration import HIDDEN, Setting
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.locate import noise_scale
from rulec.mismatch.evidence.steady.predict import Predictor
from rulec.mismatch.evidence.steady.prepare import HELDOUT
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.inference.settle import plain_of, with_sensors_as_they_are
from rulec.mismatch.result import Errors, Fit
from rulec.mismatch.search.periods import in_periods

DRAWS = 1000
CHUNKS = 20
"""Pieces of the held-out points that the bootstrap draws from."""


@dataclass(frozen=True)
class Proof:
    """The three models' predictions, shape (n,), SI, and the fit as shown.

    `judged` flags points outside of periods of faults, shape (n,).
    """

    fit: Fit
    shipped: Array
    recalibrated: Array
    repaired: Array
    judged: np.ndarray
    faulty: int


@dataclass(frozen=True)
class Models:
    """The three models to compare, fitted to all points that are not held out.

    `faulty` flags points in periods of faults, shape (n,).
    """

    shipped: Setting
    recalibrated: Setting
    repaired: Setting
    fitted: Fitted
    faulty: np.ndarray


def models_of(repaired: Fitted) -> Models:
    """The repaired model, and what it is compared with."""
    plain = plain_of(repaired.setting)
    for spot in repaired.setting.spots:
        plain = plain.leaving(spot)
    recalibrated = with_sensors_as_they_are(repaired, plain)
    return Models(
        Setting(),
        _without_periods(recalibrated.setting),
        _without_periods(repaired.setting),
        repaired,
        _faulty(repaired.rows, repaired),
    )


def gain_shown(predictor: Predictor, models: Models) -> float:
    """By how much the repair lowers the error of a reading on points that are not held out."""
    data = predictor.system.data
    measured = data.values[predictor.signal.id]
    part = predictor.points & data.open & ~models.faulty
    off = [
        (predictor.predicted(setting) - measured)[part]
        for setting in (models.recalibrated, models.repaired)
    ]
    usable = np.isfinite(off[0]) & np.isfinite(off[1])
    before, after = (rms(o[usable]) for o in off)
    return before / after if after > 0 and np.isfinite(before) else 0.0


def prove(predictor: Predictor, models: Models) -> Proof:
    """Open the held-out blocks, once."""
    rows, faulty = models.fitted.rows, models.faulty
    data = rows.system.data
    settings = (models.shipped, models.recalibrated, models.repaired)
    predictions = [predictor.predicted(setting) for setting in settings]
    measured = data.values[predictor.signal.id]
    judged = np.isfinite(measured) & predictor.points & ~faulty
    judged &= np.all([np.isfinite(p) for p in predictions], axis=0)
    local = noise_scale(rows, models.fitted.residual)
    noise = predictor.noise(models.repaired) * local
    factor = predictor.signal.factor
    errors = [(p - measured) / factor for p in predictions]
    parts = (judged & data.open, judged & (data.part == HELDOUT))
    estimation, heldout = (_errors(errors, noise / factor, part) for part in parts)
    found = Fit(
        signal=predictor.signal.id,
        unit=predictor.signal.unit,
        estimation=estimation,
        heldout=heldout,
        gain_interval=gain_interval(errors[1][parts[1]], errors[2][parts[1]]),
        closed=closed_share(heldout),
        relation=predictor.residual.id,
    )
    return Proof(found, predictions[0], predictions[1], predictions[2], judged, int(faulty.sum()))


def _without_periods(setting: Setting) -> Setting:
    """Faults in periods are no part of what a model predicts."""
    for course in setting.courses:
        candidate = setting.candidate_of(course)
        if candidate.sort != HIDDEN:
            setting = setting.leaving(candidate.id)
    return setting


def _faulty(rows: Rows, repaired: Fitted) -> np.ndarray:
    """Points in periods of faults; in held-out blocks found by the finished model."""
    data = rows.system.data
    faulty = np.zeros(len(data), dtype=bool)
    for course in repaired.setting.courses:
        candidate = repaired.setting.candidate_of(course)
        if candidate.sort == HIDDEN:
            continue
        faulty |= (course.segment >= 0) & data.open
        bare = repaired.setting.leaving(candidate.id)
        seen = fit(rows, bare, np.ones(len(data), dtype=bool), steps=0)
        trial = in_periods(seen, candidate)
        if trial is not None and trial.course is not None:
            faulty |= (trial.course.segment >= 0) & ~data.open
    return faulty


def _errors(errors: list[Array], noise: Array, part: np.ndarray) -> Errors:
    shipped, recalibrated, repaired = (rms(e[part]) for e in errors)
    return Errors(
        shipped=shipped,
        recalibrated=recalibrated,
        repaired=repaired,
        noise=rms(noise[part]),
        points=int(part.sum()),
    )


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def gain_interval(before: Array, after: Array) -> tuple[float, float]:
    """95 % interval of the fall of the error, as share of the error before.

    Source: bootstrap over blocks of consecutive points (Kunsch 1989).
    """
    if len(before) < 2:
        return (float("nan"), float("nan"))
    count = min(CHUNKS, len(before))
    edges = np.linspace(0, len(before), count + 1).astype(int)[:-1]
    sums = np.stack([np.add.reduceat(e**2, edges) for e in (before, after)])
    drawn = np.random.default_rng(0).integers(0, count, (DRAWS, count))
    totals = sums[:, drawn].sum(axis=2)
    gain = 1.0 - np.sqrt(totals[1] / np.maximum(totals[0], 1e-300))
    low, high = np.quantile(gain, [0.025, 0.975])
    return float(low), float(high)


def closed_share(errors: Errors) -> float:
    """Share of what could be explained, in squares, that the repair explains.

    Below 0 it makes worse; NaN where nothing was held out, or nothing could be explained.
    """
    explainable = errors.recalibrated**2 - errors.noise**2
    gained = errors.recalibrated**2 - errors.repaired**2
    return float(np.clip(gained / explainable, -1.0, 1.0)) if explainable > 0 else float("nan")
