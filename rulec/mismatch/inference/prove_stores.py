"""Errors of the model as shipped, recalibrated and repaired, on samples that it never saw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust import white_noise
from rulec_runtime.simulation.balances import RanAway

from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.simulation_problem import Bench
from rulec.mismatch.inference.prove import closed_share, gain_interval, rms
from rulec.mismatch.inference.series import Predicted, course_of
from rulec.mismatch.result import Errors, Fit, Series


@dataclass(frozen=True)
class Proof:
    """The fit of one reading as shown, and what the three models predict, SI, shape (n,)."""

    fit: Fit
    shipped: Array
    recalibrated: Array
    repaired: Array


def prove(bench: Bench, plain: Fitted, best: Fitted, judged: Judged) -> list[Proof]:
    """Open the held-out blocks, once; one proof per measured signal, the worst explained first.

    Slow errors of what is given, within the class of its sensors, are taken out of all three alike.
    """
    errors = [_shipped(bench, judged), plain.errors, best.errors]
    return [_proof(bench, name, [e[name] for e in errors]) for name in bench.signals]


def series_of(bench: Bench, proofs: Sequence[Proof]) -> Series:
    """What was measured and predicted, for all proofs."""
    courses = (
        course_of(
            bench.ruleset.signal_by_id[proof.fit.signal],
            bench.record.measured[proof.fit.signal],
            Predicted(proof.shipped, proof.recalibrated, proof.repaired),
        )
        for proof in proofs
    )
    return Series(bench.record.time, ~bench.record.open, tuple(courses))


def _shipped(bench: Bench, judged: Judged) -> Mapping[str, Array]:
    fitter = Fitter(bench, (), {})
    try:
        return fitter.errors(fitter.vector({}), judged)[0]
    except RanAway:
        return {n: np.full(len(v), np.nan) for n, v in bench.record.measured.items()}


def _proof(bench: Bench, name: str, errors: list[Array]) -> Proof:
    signal, record = bench.ruleset.signal_by_id[name], bench.record
    measured = record.measured[name]
    known = np.isfinite(measured) & np.all([np.isfinite(e) for e in errors], axis=0)
    shown = [e / signal.factor for e in errors]
    noise = noise_floor(measured[known]) / signal.factor
    parts = (known & record.open, known & ~record.open)
    estimation, heldout = (
        Errors(
            shipped=rms(shown[0][p]),
            recalibrated=rms(shown[1][p]),
            repaired=rms(shown[2][p]),
            noise=noise,
            points=int(p.sum()),
        )
        for p in parts
    )
    fit = Fit(
        signal=name,
        unit=signal.unit,
        estimation=estimation,
        heldout=heldout,
        gain_interval=gain_interval(shown[1][parts[1]], shown[2][parts[1]]),
        closed=closed_share(heldout),
    )
    shipped, recalibrated, repaired = (e + measured for e in errors)
    return Proof(fit, shipped, recalibrated, repaired)


def noise_floor(measured: Array) -> float:
    """Scatter of a reading by its third differences, which no plant that stores has."""
    return white_noise(np.diff(measured, 3), 3)
