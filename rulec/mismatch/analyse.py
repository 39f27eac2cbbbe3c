"""From a recording to an answer: the steps of the comparison in order, for any evidence."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.report.text import listed

from rulec.effects.model_builder import ModelBuilder
from rulec.knowledge.parameter_belief import Strain, strain_of
from rulec.limits import STRAINED
from rulec.mismatch import limits, steady
from rulec.mismatch.answer.findings import findings_of, location_of, untested
from rulec.mismatch.answer.verdict import (
    Doubt,
    headline_of,
    next_step,
    remainder_of,
    verdict_of,
    with_misread,
)
from rulec.mismatch.answer.written_plant import (
    Explained,
    NotComparable,
    PlantErrors,
    checks_of,
    refusal,
    written,
)
from rulec.mismatch.evidence.configuration import ERROR
from rulec.mismatch.evidence.failing_sensors import failed_at
from rulec.mismatch.evidence.model import Model
from rulec.mismatch.inference.heldout_errors import MODELS, confounded, heldout_spans
from rulec.mismatch.inference.power import self_proof
from rulec.mismatch.result import Curves, Finding, Fit, Mismatch, Repair, Series
from rulec.mismatch.structure import hypotheses as structure
from rulec.mismatch.structure.hypotheses import CONNECTION, AcceptedHypothesis
from rulec.mismatch.structure.settled import Settled
from rulec.mismatch.structure.structure_search import Evidence as StructureEvidence
from rulec.mismatch.structure.structure_search import structure_of

NO_CLOCK = (
    "these {what} have no common time, so rulec did not look for changes with time, nor for faults "
    "that begin, or come and go"
)
"""The note where effects of time cannot be judged."""

Progress = Callable[[str], None]


def analyse(
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
    *,
    heldout: Sequence[tuple[float, float]] = (),
    power: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Mismatch:
    """Compare a recording with the model of its plant: whether, where and why they differ, with
    proof.

    Parameters
    ----------
    heldout : spans of time, s, that are opened once, at the end; without them, blocks are held out.
    power : ids of candidates that are concealed in replays of the recording; empty: those that
        remain possible; None: nothing is replayed.
    progress : is called with the name of each step.
    """
    begin = time.perf_counter()
    tell: Progress = progress or (lambda text: None)
    judged_by, explain = _engine(ruleset)
    checked = structure_of(recording, judged_by(ruleset, builder, heldout), tell)
    recording, taken = checked.recording, checked.taken
    ruleset, builder = checked.evidence.ruleset, checked.evidence.builder
    found = explain(recording, ruleset, builder, heldout, tell)
    if isinstance(found, NotComparable):
        return _cannot(recording, ruleset, found, taken, begin)
    model = found.model
    tell("working out uncertainties")
    named = findings_of(model, found.accepted)
    tell("opening the held-out blocks")
    proofs = found.proofs(named)
    tell("writing the plants and simulating them")
    refits, shown = written(found, proofs)
    misread = structure.findings_of(taken)
    findings = (*named, *found.failing)
    locations = (
        *(location_of(model, f, found.accepted) for f in named),
        *(failed_at(f) for f in found.failing),
        *found.locations,
    )
    plain, repair = refits.repairs
    plants, fits, samples = shown.plants, shown.fits, model.samples
    doubt = _doubt(found, fits)
    verdict = verdict_of(findings, bool(found.locations), doubt)
    spans = heldout_spans(samples.time, ~samples.open)
    checks = checks_of(plants, recording, spans) if plants else ()
    unwritten = plants.refused if plants else ""
    recalibrated = _strain(found, {p.id: p.value for p in plain.parameters})
    instead = all(strain.is_believable for strain in recalibrated)
    refused = refusal(verdict, fits, repair.joined, unwritten, checks, instead, repair.curves)
    unwritable = "" if repair.joined else "; ".join(dict.fromkeys(w for _, w in refits.left_out))
    replayed = None
    if power is not None:
        tell("replaying the recording")
        replayed = self_proof(found.posterior, builder.candidates, power)
    before, behind = found.notes(refits, proofs, fits, shown.why)
    unknowns = frozenset(u.id for c in model.joined for u in c.unknowns)
    standing = found.standing
    beyond = [s for s in standing if frozenset(s.names) not in found.posterior.tolerated]
    verdict, headline, then = with_misread(
        verdict,
        headline_of(verdict, findings, locations, doubt, fits, beyond)
        + remainder_of(verdict, fits, doubt.unbelievable, not unwritable),
        next_step(
            verdict,
            findings,
            found.latent_input,
            model.builder.missing,
            refused,
            locations,
            standing,
            curves=bool(repair.curves),
            unwritable=unwritable,
        ),
        misread,
    )
    return Mismatch(
        plant=ruleset.plant,
        title=ruleset.title,
        recording="",
        verdict=verdict,
        headline=headline,
        locations=(*structure.locations_of(taken, ruleset), *locations),
        findings=(*misread, *findings),
        fit=fits[0] if fits else None,
        fits=fits,
        confounded=confounded(model.free, model.covariance, unknowns),
        latent_input=found.latent_input,
        untested=untested(model, named),
        next=then,
        split=samples.split,
        digest=samples.digest,
        noise=found.noise,
        tried=len(found.posterior.models),
        notes=(
            *_read_so(misread),
            *before,
            *([] if samples.timed else [NO_CLOCK.format(what=found.untimed)]),
            *_of_curves(model.builder, repair),
            *_of_recording(recording),
            *behind,
        ),
        repair=repair,
        plain=plain,
        curves=_curves(model, shown, refits.judged, findings) if fits else None,
        seconds=time.perf_counter() - begin,
        series=shown.series,
        evidence=found.rows_used(proofs),
        left_out=refits.left_out,
        refused=refused,
        checks=checks,
        misread=structure.misread_of(taken),
        rewired=structure.rewired_of(taken),
        standing=standing,
        recordings=found.recordings,
        changed=found.changed,
        strain=doubt.strain,
        power=replayed,
    )


def _doubt(found: Explained[Any], fits: Sequence[Fit]) -> Doubt:
    strain = (*_strain(found, found.believed), *_of_sensors(found))
    signals, beyond = found.model.ruleset.signal_by_id, []
    for fit in fits:
        error = max(fit.estimation.repaired, fit.heldout.repaired) * signals[fit.signal].factor
        noise = limits.FAR_OFF * fit.heldout.noise * signals[fit.signal].factor
        if error > np.hypot(noise, found.allowed.get(fit.signal, np.inf)):
            size = float(np.sqrt(np.nanmean(found.recording.values[fit.signal] ** 2)))
            beyond.append((fit, error / size))
    return Doubt(found.nothing, tuple(beyond), strain)


def _strain(found: Explained[Any], values: Mapping[str, float]) -> tuple[Strain, ...]:
    """Values, SI, that lie far from the data sheets."""
    base = found.model.builder.parameters
    units = dict(zip(base.ids, zip(base.units, base.factors.tolist(), strict=True), strict=True))
    return strain_of(values, base.sheet, units)


def _of_sensors(found: Explained[Any]) -> Iterator[Strain]:
    """Errors of sensors that lie far outside their class."""
    for name, times in found.believed.items():
        signal = found.model.ruleset.signal_by_id.get(name.removeprefix(ERROR))
        if name.startswith(ERROR) and signal and abs(times) > STRAINED:
            of_class = systematic_u(signal, found.recording.values[signal.id])
            u = float(np.nanmedian(of_class)) / signal.factor
            yield Strain(f"error of {signal.id}", times * u, 0.0, u, signal.unit, "class")


def _engine(
    ruleset: Ruleset,
) -> tuple[Callable[..., StructureEvidence], Callable[..., Explained[Any] | NotComparable]]:
    """What judges the structure of a plant, and what explains its recordings."""
    if ruleset.dynamics is None:
        return Settled, steady.explain
    # Loaded here: a plant that stores nothing needs no integrator.
    from rulec.mismatch import stores
    from rulec.mismatch.structure.stores import Stores

    return Stores, stores.explain


def _read_so(misread: Sequence[Finding]) -> list[str]:
    """Notes that the answer holds for corrected columns or connections."""
    columns = "; ".join(f.text for f in misread if f.name != CONNECTION)
    pipes = "; ".join(f.text for f in misread if f.name == CONNECTION)
    notes = []
    if columns:
        notes.append(
            f"all results, and what is adopted, hold for the corrected recording: {columns}"
        )
    if pipes:
        notes.append(
            f"all results hold for the plant connected as the readings say: {pipes}. Until the "
            "plant file is edited, rulec adopt writes nothing"
        )
    return notes


def _of_curves(builder: ModelBuilder, repair: Repair) -> list[str]:
    """A remark on what the repaired plant holds without physics."""
    terms = [(builder.location_by_id[curve.place], curve.driver) for curve in repair.curves]
    places = [f"{location.module}.{location.place} over {driver}" for location, driver in terms]
    return [
        f"the repaired plant also holds what has no name, as a curve: {listed(places)}. Outside of "
        "this recording it may be wrong, and it may hide a fault"
    ] * bool(places)


def _of_recording(recording: Recording) -> list[str]:
    return [*recording.notes, *(f"{name} is not in the recording" for name in recording.missing)]


def _curves(
    model: Model, shown: PlantErrors, judged: np.ndarray, findings: Sequence[Finding]
) -> Curves:
    """Courses of the first reading with errors; `judged`, shape (n,): see `Refits`."""
    course = shown.series.courses[0]
    signal = course.signal
    module = findings[0].module if findings else signal.partition(".")[0]
    drivers = {
        f"{name} [{variable.unit}]": variable.shown(variable.course)
        for name, variable in model.variables(module).items()
        if name != signal
    }
    predicted = np.isfinite(course.recalibrated + course.repaired + course.measured)
    return Curves(
        time=shown.series.time,
        heldout=shown.series.heldout,
        drivers=drivers,
        inside=judged & predicted,
        measured=course.measured,
        **{name: getattr(course, name) for name in MODELS},
    )


def _cannot(
    recording: Recording,
    ruleset: Ruleset,
    blind: NotComparable,
    taken: Sequence[AcceptedHypothesis],
    begin: float,
) -> Mismatch:
    samples, misread = blind.samples, structure.findings_of(taken)
    _, headline, then = with_misread(
        "cannot judge", f"Cannot judge: {blind.why}.", blind.next, misread
    )
    return Mismatch(
        plant=ruleset.plant,
        title=ruleset.title,
        recording="",
        verdict="cannot judge",
        headline=headline,
        next=then,
        locations=tuple(structure.locations_of(taken, ruleset)),
        findings=misread,
        split=samples.split if samples else "",
        digest=samples.digest if samples else "",
        notes=(*_read_so(misread), *_of_recording(recording)),
        seconds=time.perf_counter() - begin,
        series=Series(samples.time, ~samples.open) if samples else None,
        evidence=blind.evidence,
        misread=structure.misread_of(taken),
        rewired=structure.rewired_of(taken),
    )
