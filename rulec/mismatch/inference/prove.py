"""Errors of the shipped, the recalibrated and the repaired model on held-out samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec

from rulec.mismatch.inference import limits
from rulec.mismatch.inference.series import Predicted
from rulec.mismatch.result import Errors, Fit


@dataclass(frozen=True)
class Proof:
    """The fit of one reading as shown, and the predictions of the three models.

    `judged`, shape (n,), flags samples whose errors count.
    """

    fit: Fit
    predicted: Predicted
    judged: np.ndarray


def fit_of(
    signal: SignalSpec,
    errors: Sequence[Array],
    noise: tuple[float, float],
    parts: tuple[np.ndarray, np.ndarray],
    explained: tuple[float, float] = (np.nan, np.nan),
) -> Fit:
    """The errors of a reading as shown.

    Parameters
    ----------
    errors : predicted minus measured of shipped, recalibrated and repaired model, SI, shape (n,).
    noise : root mean square of the noise of the reading in both parts, SI.
    parts : flags of the open and of the held-out samples, shape (n,).
    explained : errors of the whole explanation in both parts, as shown.
    """
    known = np.all([np.isfinite(e) for e in errors], axis=0)
    shown = [e / signal.factor for e in errors]
    inside = [part & known for part in parts]
    estimation, heldout = (
        Errors(
            shipped=rms(shown[0][part]),
            recalibrated=rms(shown[1][part]),
            repaired=rms(shown[2][part]),
            noise=size / signal.factor,
            points=int(part.sum()),
            explained=own,
        )
        for part, size, own in zip(inside, noise, explained, strict=True)
    )
    return Fit(
        signal=signal.id,
        unit=signal.unit,
        estimation=estimation,
        heldout=heldout,
        gain_interval=gain_interval(shown[1][inside[1]], shown[2][inside[1]]),
        closed=closed_share(heldout),
    )


def rms(values: Array) -> float:
    """Root mean square of values, shape (n,); NaN for none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def gain_interval(before: Array, after: Array) -> tuple[float, float]:
    """95 % interval of the fall of the error, as a share of the error before; shape (n,) each.

    Source: bootstrap over blocks of consecutive points (Kunsch 1989).
    """
    if len(before) < 2:
        return (float("nan"), float("nan"))
    count = min(limits.CHUNKS, len(before))
    edges = np.linspace(0, len(before), count + 1).astype(int)[:-1]
    sums = np.stack([np.add.reduceat(e**2, edges) for e in (before, after)])
    drawn = np.random.default_rng(0).integers(0, count, (limits.DRAWS, count))
    totals = sums[:, drawn].sum(axis=2)
    gain = 1.0 - np.sqrt(totals[1] / np.maximum(totals[0], 1e-300))
    low, high = np.quantile(gain, [0.025, 0.975])
    return float(low), float(high)


def closed_share(errors: Errors) -> float:
    """Share of the explainable squared error that the repair explains.

    Negative if the repair makes it worse; NaN if nothing was held out or explainable.
    """
    explainable = errors.recalibrated**2 - errors.noise**2
    gained = errors.recalibrated**2 - errors.repaired**2
    return float(np.clip(gained / explainable, -1.0, 1.0)) if explainable > 0 else float("nan")
