"""What may be written of an explanation of a plant that stores, fitted alone, and what it is worth.

As `writable.py`. Sensors read as they are: neither a slow error of what is given nor
a zero that floats belongs to the plant that is simulated later, so neither is in the fit. What a
fault does stays in what is stored: samples behind its onset are set aside in the fit. Errors that
are told are those of all samples: a fault may be none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.thin import thinned
from rulec_runtime.simulation.balances import RanAway
from rulec_runtime.simulation.equations import SimulationRefused

from rulec.effects.adopt import why_not
from rulec.effects.candidate import Candidate, Unwritable
from rulec.mismatch.answer.public import Plants, fit_of, plants_of
from rulec.mismatch.answer.writable import KEPT
from rulec.mismatch.evidence.stores.drift import no_drift
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.record import without_odd
from rulec.mismatch.evidence.stores.simulation_problem import Bench
from rulec.mismatch.inference.prove_stores import Proof, noise_floor
from rulec.mismatch.inference.series import Predicted, course_of, heldout_spans
from rulec.mismatch.result import Changed, Fit, Repair, Series

EVALUATIONS, ROUNDS = 60, 2
"""Of a refit, as of the models that the search ends with."""


@dataclass(frozen=True)
class Writable:
    """The recalibrated and the repaired model as they are written, and what was left out.

    Samples from `until` on (s of the recording) lie behind the onset of a fault.
    """

    plain: Fitted
    fitted: Fitted
    left_out: tuple[tuple[str, str], ...]
    until: float

    @property
    def repairs(self) -> tuple[Repair, Repair]:
        """What to write for each."""
        return _repair(self.plain), _repair(self.fitted)


def writable(bench: Bench, plain: Fitted, best: Fitted, kept: Mapping[str, float]) -> Writable:
    """Refit what may be written, and the plain model; `kept` are values that stay."""
    reasons = [(c, why_not(c, bench.builder.network)) for c in best.joined]
    left = tuple((c.id, why) for c, why in reasons if why)
    taken = tuple(c for c, why in reasons if not why)
    until = _until(bench, best, [c for c, why in reasons if why])
    here = bench.record.time < until
    known = {n: flags & here for n, flags in bench.known.items()}
    judged = Judged(known, best.noise, no_drift(bench), np.zeros(0))
    first = _refitted(bench, (), {}, [plain.values, {}], judged)
    if not taken:
        return Writable(first, first, left, until)
    own = {u.id for c in taken for u in c.unknowns}
    kept = {n: v for n, v in kept.items() if n in own}
    beside = {n: v for n, v in best.values.items() if n in own}
    starts = [best.values, {**first.values, **beside}]
    return Writable(first, _refitted(bench, taken, kept, starts, judged), left, until)


def _until(bench: Bench, best: Fitted, left: Sequence[Candidate]) -> float:
    """When the first of what no model holds begins; never where that leaves too little."""
    record = bench.record
    onsets = [best.values[c.onset.id] for c in left if c.onset is not None]
    until = float(record.time[0]) + min(onsets, default=np.inf)
    enough = (record.open & (record.time < until)).sum() >= KEPT * record.open.sum()
    return until if enough else np.inf


def _refitted(
    bench: Bench,
    joined: tuple[Candidate, ...],
    kept: Mapping[str, float],
    starts: Sequence[Mapping[str, float]],
    judged: Judged,
) -> Fitted:
    """The best fit from several starts, with its covariance."""
    fitter = Fitter(bench, joined, kept)
    found = []
    for start in starts:
        try:
            found.append(fitter.finish(fitter.vector(start), judged, EVALUATIONS, ROUNDS))
        except RanAway:
            continue
    best = min(found, key=lambda f: _squares(f, judged))
    return fitter.with_covariance(best, replace(judged, slow=best.slow))


def _squares(fitted: Fitted, judged: Judged) -> float:
    """Squares of errors in one and the same noise, and what priors cost."""
    errors = np.concatenate(list(fitted.errors.values()))
    weighted = (errors / judged.weights())[judged.flags()]
    return 0.5 * float(weighted @ weighted) + fitted.strain


def _repair(fitted: Fitted) -> Repair:
    return Repair(
        fitted.ids,
        tuple(Changed(n, float(fitted.values[n]), fitted.u(n)) for n in fitted.free),
        fitted.covariance,
        {n: v for n, v in fitted.values.items() if n not in fitted.free},
        {},
        {},
    )


@dataclass(frozen=True)
class Told:
    """Errors of the three plants, and their courses at the samples of the analysis, SI."""

    fits: tuple[Fit, ...]
    series: Series
    curves: Mapping[str, Predicted]
    plants: Plants


def told(
    recording: Recording,
    bench: Bench,
    model: Writable,
    proofs: Sequence[Proof],
    repairs: tuple[Repair, Repair],
) -> Told | None:
    """Simulate the plants over all rows of the recording; None where that cannot be done."""
    record, time = bench.record, recording.time
    try:
        plants = plants_of(bench.ruleset, bench.builder, recording, *repairs)
    except (SimulationRefused, Unwritable):
        return None
    spans = heldout_spans(record.time, ~record.open)
    held = np.any([(time >= low) & (time <= high) for low, high in spans] or [time < time], 0)
    fits, courses, curves = [], [], {}
    for proof in proofs:
        name = proof.fit.signal
        if name not in plants.signals:
            continue
        signal = bench.ruleset.signal_by_id[name]
        measured = without_odd(signal, recording.values[name])
        tables = [t[name] for t in (plants.shipped, plants.recalibrated, plants.last)]
        found = fit_of(
            signal,
            [course - measured for course in tables],
            noise_floor(measured[np.isfinite(measured)]),
            (~held, held),
            (proof.fit.estimation.repaired, proof.fit.heldout.repaired),
        )
        fits.append(replace(found, simulated=True))
        curves[name] = Predicted(*(_thin(bench, recording, course) for course in tables))
        courses.append(course_of(signal, record.measured[name], curves[name]))
    if not fits:
        return None
    return Told(tuple(fits), Series(record.time, ~record.open, tuple(courses)), curves, plants)


def _thin(bench: Bench, recording: Recording, course: Array) -> Array:
    """A course at the samples of the analysis."""
    factor = len(recording.time) // len(bench.record.time)
    return thinned(recording.time, {}, {"": course}, factor)[2][""]
