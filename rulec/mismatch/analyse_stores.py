"""From a recording of a plant that stores to an answer: the steps of the comparison in order."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import listed

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch.answer.answered import Explained, answered
from rulec.mismatch.answer.tell_stores import findings_of, location_of, place_of
from rulec.mismatch.answer.verdict import FAR
from rulec.mismatch.answer.writable_stores import Told, Writable, told, writable
from rulec.mismatch.evidence.failing_sensors import failed_at, failing, impossible
from rulec.mismatch.evidence.rows_used import NO_CLOCK, stored_evidence
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter
from rulec.mismatch.evidence.stores.locate import Suspect, suspects
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.evidence.stores.record import Record, record_of
from rulec.mismatch.evidence.stores.simulation_problem import Bench
from rulec.mismatch.evidence.stores.terms import variables_of
from rulec.mismatch.inference.prove_stores import Proof, noise_floor, prove, series_of
from rulec.mismatch.inference.series import Predicted, heldout_spans
from rulec.mismatch.inference.settle import REPAIRING
from rulec.mismatch.result import Curves, Finding, Location, Mismatch
from rulec.mismatch.search.stores.backward_elimination import Accepted, confounded, doubted
from rulec.mismatch.search.stores.onset_refinement import sharpened
from rulec.mismatch.search.stores.price import needed
from rulec.mismatch.search.stores.search import Found, Progress, search
from rulec.mismatch.search.stores.searcher import Searcher

NEARLY = 2.0
"""Places whose gain is within this of the best are not told from it."""

ALIKE = 0.02
"""Places that explain as much but for this share of the squared errors are not told apart."""

LEFT = 0.3
"""Share of the squared errors that an error of free course must explain for a place to be told."""

OPEN = 0.2
"""Share of what was to be explained (squares beyond noise) that names may leave: with more left
they stand for something else. Where names were right they left 0.05 at most in plants made by the
proof, and 0.13 in real tanks."""

BEYOND = 1.15
"""Errors of a model over noise from which on something is left at all."""

PROVEN = 1.0
"""Log likelihood that names must gain on held-out blocks, or may lose where no reading of those
is off by more than noise: after a step, say, that they do not have."""


def analyse_stores(
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
    *,
    heldout: Sequence[tuple[float, float]] = (),
    progress: Progress | None = None,
) -> Mismatch | None:
    """Compare a recording with a plant that stores; None where nothing can be compared."""
    begin = time.perf_counter()
    tell: Progress = progress or (lambda text: None)
    record = record_of(recording, ruleset, builder.given, heldout)
    if record is None:
        return None
    bench = Bench(ruleset, builder, record)
    workers = max(1, min(os.cpu_count() or 1, 8))
    found = search(bench, tell, workers)
    searcher = Searcher(bench, found.judged, workers)
    tell("leaving out and exchanging explanations")
    best, accepted = doubted(searcher, found)
    best = sharpened(searcher, best, found.plain)
    best = Fitter(bench, best.joined, searcher.kept(best)).with_covariance(best, found.judged)
    tell("opening the held-out blocks")
    proofs = prove(bench, found.plain, best, found.judged)
    dropped: tuple[str, ...] = ()
    far = _open_share(bench, proofs) > OPEN
    if accepted and (far or not _holds(best, proofs)):
        # What is named leaves most of it, or does not hold where it was not fitted.
        if not far:
            dropped = tuple(f"{a.candidate.title} in {a.candidate.module}" for a in accepted)
        best, accepted = found.plain, ()
        best = Fitter(bench, (), {}).with_covariance(best, found.judged)
        proofs = prove(bench, found.plain, best, found.judged)
    tell("looking for places where something is wrong")
    left = suspects(bench, _sharp(bench, best), found.judged)
    tell("working out uncertainties")
    broken = (*failing(recording, ruleset), *impossible(recording, ruleset))
    findings = (*findings_of(searcher, best, accepted), *broken)
    tell("writing the plants and simulating them")
    model = writable(bench, found.plain, best, searcher.kept(best))
    proofs = sorted(proofs, key=lambda p: -_worse(p))
    shown = told(recording, bench, model, proofs, model.repairs)
    explained = _explained(
        recording,
        bench,
        found,
        best,
        accepted,
        findings,
        left,
        proofs,
        model,
        shown,
        _took_part(dropped),
        begin,
    )
    return answered(recording, ruleset, explained)


def _took_part(dropped: Sequence[str]) -> list[str]:
    """What is said where held-out blocks had a say."""
    if not dropped:
        return []
    return [
        f"{listed(dropped)} fitted and gained nothing on the held-out blocks, and so is not named: "
        "these blocks took part in the answer, and prove no more than the others"
    ]


def _holds(best: Fitted, proofs: Sequence[Proof]) -> bool:
    """Do names gain on blocks that played no part in finding them?"""
    gained, seen, learnt = 0.0, False, False
    for proof in proofs:
        errors, before = proof.fit.heldout, proof.fit.estimation
        fall = np.log(errors.recalibrated / max(errors.repaired, 1e-300))
        gained += errors.points / best.noise[proof.fit.signal].memory * float(fall)
        seen = seen or errors.recalibrated > BEYOND * errors.noise
        learnt = learnt or before.recalibrated > BEYOND * before.noise
    return gained > (-PROVEN if learnt and not seen else PROVEN)


def _open_share(bench: Bench, proofs: Sequence[Proof]) -> float:
    """Share of squared errors beyond noise that a model leaves, of those of the plain one."""
    before = after = 0.0
    beyond = False
    for proof in proofs:
        errors, signal = proof.fit.estimation, bench.ruleset.signal_by_id[proof.fit.signal]
        noise = max(errors.noise, bench.record.resolution[signal.id] / signal.factor)
        before += (max(errors.recalibrated / noise, 1.0) ** 2 - 1.0) * errors.points
        after += (max(errors.repaired / noise, 1.0) ** 2 - 1.0) * errors.points
        beyond = beyond or errors.repaired > BEYOND * noise
    return after / before if beyond and before > 0.0 else 0.0


def _sharp(bench: Bench, fitted: Fitted) -> Fitted:
    """A model whose errors count as far as they exceed noise: that is what a place may explain."""
    return replace(fitted, noise={n: Noise(floor, 1.0) for n, floor in _floors(bench).items()})


def _floors(bench: Bench) -> dict[str, float]:
    """Standard deviation of the noise of each measured signal, SI."""
    record = bench.record
    return {
        n: max(noise_floor(v[np.isfinite(v)]), record.resolution[n])
        for n, v in record.measured.items()
    }


def _explained(
    recording: Recording,
    bench: Bench,
    found: Found,
    best: Fitted,
    accepted: tuple[Accepted, ...],
    findings: tuple[Finding, ...],
    left: list[Suspect],
    proofs: Sequence[Proof],
    model: Writable,
    shown: Told | None,
    notes: Sequence[str],
    begin: float,
) -> Explained:
    nameless = _nameless(bench, best, left, len(bench.candidates))
    locations = tuple(
        location_of(bench, best, f) if f.id in best.ids else failed_at(f) for f in findings
    )
    fits = shown.fits if shown else tuple(p.fit for p in proofs)
    return Explained(
        findings=findings,
        locations=locations if best.joined else (*nameless, *locations),
        unnamed=bool(nameless) and not best.joined,
        hidden=None,
        missing=bench.builder.missing,
        confounded=confounded(best),
        untested=_untested(bench, best, findings),
        fits=fits,
        plants=shown.plants if shown else None,
        repairs=model.repairs,
        left_out=model.left_out,
        heldout=heldout_spans(bench.record.time, ~bench.record.open),
        curves=_curves(bench, best, fits[0].signal, _predicted(shown, proofs), findings),
        series=shown.series if shown else series_of(bench, proofs),
        evidence=stored_evidence(recording, bench.record),
        notes=(
            *notes,
            *_hiding(found, accepted),
            *_still(nameless, findings),
            *_notes(recording, bench),
            *_unproven(shown, model),
        ),
        split=bench.record.split,
        digest=bench.record.digest,
        noise=_noise_told(best),
        tried=found.tried,
        begin=begin,
    )


def _predicted(shown: Told | None, proofs: Sequence[Proof]) -> Predicted:
    """What the three plants predict of the first reading."""
    if shown:
        return shown.curves[shown.fits[0].signal]
    return Predicted(proofs[0].shipped, proofs[0].recalibrated, proofs[0].repaired)


def _unproven(shown: Told | None, model: Writable) -> list[str]:
    """What the errors that are told do not show."""
    notes = []
    if shown is None:
        notes.append("errors are those of the analysis: rulec simulate cannot predict this plant")
    if np.isfinite(model.until):
        notes.append(
            f"a fault begins at {model.until:.4g} s; values to adopt are fitted to what lies "
            "before it, errors are those of all samples"
        )
    return notes


def _worse(proof: Proof) -> float:
    """How much of an error there was, in noise."""
    errors = proof.fit.estimation
    return errors.recalibrated / max(errors.noise, 1e-300)


def _nameless(bench: Bench, best: Fitted, left: list[Suspect], tried: int) -> tuple[Location, ...]:
    """The place where the final model is still wrong, if it is so beyond doubt, the likeliest
    first, and all that are not told from it."""
    if not left or left[0].gain < needed(tried):
        return ()
    floors = _floors(bench)
    far = any(noise.spread > FAR * floors[n] for n, noise in best.noise.items())
    # A model that is far off has no straight way back: then the likeliest place must do.
    if left[0].share < LEFT and not far:
        return ()
    steps = bench.record.resolution
    if all(noise.spread < BEYOND * steps[n] for n, noise in best.noise.items()):
        return ()
    first = left[0]
    near = [s for s in left if s.gain > first.gain - NEARLY or s.share > first.share - ALIKE]
    return tuple(place_of(bench, best, s, tuple(o for o in near if o is not s)) for s in near)


def _untested(bench: Bench, best: Fitted, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Ranges beyond which a repaired law was never tried."""
    told: dict[str, None] = {}
    drivers = {d for c in best.joined if c.sort in REPAIRING for d in c.drivers.values()}
    variables = variables_of(bench, best, findings[0].module) if findings else {}
    for name, (course, factor, offset, unit) in variables.items():
        if name in drivers:
            low, high = (
                (float(course.min()) - offset) / factor,
                (float(course.max()) - offset) / factor,
            )
            told[f"{name} below {low:.4g} or above {high:.4g} {unit}"] = None
    return tuple(told)


def _noise_told(best: Fitted) -> str:
    parts = [f"{n} for {noise.memory:.0f} samples" for n, noise in best.noise.items()]
    return (
        "noise by third differences of the readings; errors of the repaired model stay alike "
        f"({', '.join(parts)}), and count once in that time"
    )


def _notes(recording: Recording, bench: Bench) -> list[str]:
    record: Record = bench.record
    clock = [] if record.timed else [NO_CLOCK.format(what="files, each with a clock of its own,")]
    notes = [
        *clock,
        *recording.notes,
        *(f"{name} is not in the recording" for name in recording.missing),
    ]
    for name, count in record.glitches.items():
        if count:
            notes.append(f"{count} single readings of {name} that no neighbour bears out left out")
    return notes


def _hiding(found: Found, accepted: tuple[Accepted, ...]) -> list[str]:
    """Which explanations only show together."""
    hidden = [a for a in accepted if found.alone.get(a.candidate.id, 0.0) < 0.5 * a.gain]
    if len(accepted) < 2 or not hidden:
        return []
    told = (
        f"{a.candidate.title.lower()} in {a.candidate.module} gains "
        f"{found.alone.get(a.candidate.id, 0.0):.0f} alone and {a.gain:.0f} beside the others"
        for a in hidden
    )
    return [f"these hide each other (gain in log likelihood): {'; '.join(told)}"]


def _still(nameless: tuple[Location, ...], findings: Sequence[Finding]) -> list[str]:
    """What the repaired model leaves."""
    if not nameless or not findings:
        return []
    place = nameless[0]
    return [
        f"what is left is not noise: an error of {place.module}.{place.place} in time would "
        f"explain {100 * place.share:.0f} % of it; no further entry of the catalogue does"
    ]


def _curves(
    bench: Bench, best: Fitted, name: str, predicted: Predicted, findings: Sequence[Finding]
) -> Curves:
    signal = bench.ruleset.signal_by_id[name]
    module = findings[0].module if findings else signal.id.partition(".")[0]

    def shown(values: np.ndarray) -> np.ndarray:
        return np.asarray((values - signal.offset) / signal.factor)

    drivers = {
        f"{name} [{unit}]": (course - offset) / factor
        for name, (course, factor, offset, unit) in variables_of(bench, best, module).items()
    }
    measured = bench.record.measured[signal.id]
    return Curves(
        bench.record.time,
        shown(measured),
        shown(predicted.shipped),
        shown(predicted.recalibrated),
        shown(predicted.repaired),
        ~bench.record.open,
        drivers,
        np.isfinite(measured),
    )
