"""From a recording to an answer: the steps of the comparison in order."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import counted, fixed, listed

from rulec.effects.candidate import Spot
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch.answer.answered import Explained, answered
from rulec.mismatch.answer.tell import findings_of, location_of, shares_of, term_of
from rulec.mismatch.answer.verdict import next_step
from rulec.mismatch.answer.writable import Told, Writable, told, writable
from rulec.mismatch.evidence.failing_sensors import failed_at, impossible, stuck
from rulec.mismatch.evidence.rows_used import NO_CLOCK, counted_rows, evidence_of, unread
from rulec.mismatch.evidence.steady.configuration import Setting
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.locate import (
    alike,
    noise_scale,
    region_of,
    suspects,
    variables_of,
)
from rulec.mismatch.evidence.steady.predict import Predictor, predictors_for
from rulec.mismatch.evidence.steady.prepare import HELDOUT, Data, prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.inference.interval import confounded
from rulec.mismatch.inference.prove import Models, Proof, gain_shown, models_of, prove
from rulec.mismatch.inference.series import heldout_spans
from rulec.mismatch.inference.settle import with_sensors_as_they_are
from rulec.mismatch.result import (
    Curves,
    Evidence,
    Finding,
    HiddenDriver,
    Location,
    Mismatch,
    Series,
)
from rulec.mismatch.search.latent_input import Reconstruction, described, likeness, reconstruct
from rulec.mismatch.search.search import Search, search

FEWEST = 12
"""Settled points below which nothing can be compared."""

FAR_MOVED = 5.0
"""Stated uncertainties by which a parameter may move before it is worth a remark."""

SHOWN = 4
"""Readings that are named where many have no number."""

TRIED = 5
"""Readings per finding among which the one that shows it best is chosen."""

Progress = Callable[[str], None]


def analyse(
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
    *,
    heldout: Sequence[tuple[float, float]] = (),
    progress: Progress | None = None,
) -> Mismatch:
    """Compare a recording with the model of its plant: is there a mismatch, where, what, proof.

    Parameters
    ----------
    heldout : spans of time, s, that are opened once, at the end; without them, blocks are set
        aside.
    progress : is told what is being done.
    """
    begin = time.perf_counter()
    tell: Progress = progress or (lambda text: None)
    if ruleset.dynamics is not None:
        # Loaded here: a plant that stores nothing needs no integrator.
        from rulec.mismatch.analyse_stores import analyse_stores
        from rulec.mismatch.evidence.stores.record import lacking

        stored = analyse_stores(recording, ruleset, builder, heldout=heldout, progress=progress)
        if stored is not None:
            return stored
        why = lacking(recording, ruleset)
        counted = counted_rows((), [*unread(recording), *[why] * len(recording)])
        blind = _cannot(recording, ruleset, None, why, begin)
        return replace(blind, next="Record again, with what lacks.", evidence=counted)
    tell("finding settled points")
    data = prepare(recording, ruleset, heldout)
    count = 0 if data is None else int(data.open.sum())
    if data is None or count < FEWEST:
        why = f"{count} settled points; at least {FEWEST} are needed"
        return _cannot(recording, ruleset, data, why, begin)
    system = System(ruleset, builder, data)
    rows = rows_of(system, Setting())
    if rows.groups < FEWEST:
        why = "no two estimates of one flow can be compared with the readings of this recording"
        blind = _cannot(recording, ruleset, data, why, begin)
        counted = evidence_of(recording, data, rows)
        return replace(blind, next=_to_be_read(recording) or blind.next, evidence=counted)
    found = search(rows, tell)
    hidden = _hidden(found)
    tell("working out uncertainties")
    findings = findings_of(found.best, found.accepted)
    tell("opening the held-out blocks")
    settled = with_sensors_as_they_are(found.best.fitted)
    models = models_of(settled)
    opened = [(p, prove(p, models)) for p in _predictors(system, findings, hidden, models)]
    # A fault may hold all samples of a reading that are held out: nothing is proven there.
    opened = [o for o in opened if o[1].fit.heldout.points] or opened
    predictors, proofs = [p for p, _ in opened], [proof for _, proof in opened]
    tell("writing the plants and simulating them")
    model = writable(settled, models.faulty)
    shown = told(recording, model, predictors, proofs, model.repairs)
    judged = np.any([proof.judged for proof in proofs], axis=0) if proofs else None
    counted = evidence_of(recording, data, rows, judged, models.faulty)
    explained = _explained(recording, found, findings, proofs, model, shown, hidden, counted, begin)
    return answered(recording, ruleset, explained)


def _hidden(found: Search) -> tuple[Reconstruction, ...]:
    """Places that follow a driver that nobody recorded, the first that was found first."""
    fitted = found.best.fitted
    return tuple(reconstruct(fitted, spot) for spot in fitted.setting.spots)


def _predictors(
    system: System,
    findings: Sequence[Finding],
    hidden: Sequence[Reconstruction],
    models: Models,
) -> list[Predictor]:
    """The readings in whose units errors are told: for each finding that which shows it best.

    That is the flow meter, where there is one; flows come first.
    """
    candidates = {c.id: c for c in system.builder.candidates}
    spots = {(s.module, s.place): s for s in system.builder.spots}
    places: list[tuple[tuple[str, ...], frozenset[str], str]] = []
    for finding in findings:
        if finding.id in candidates:
            candidate = candidates[finding.id]
            spot = spots.get((finding.module, finding.place))
            drivers = frozenset(candidate.drivers.values())
            places.append((candidate.observers, drivers, spot.unit if spot else ""))
    places += [(h.spot.observers, frozenset(), h.spot.unit) for h in hidden]
    places = places or [(tuple(o.id for o in system.observers), frozenset(), "")]
    found: dict[str, Predictor] = {}
    for place in places:
        natural = predictors_for(system, *place)[:TRIED]
        if natural and not natural[0].of_flow:
            natural.sort(key=lambda p: -round(gain_shown(p, models), 3))
        found.update({p.signal.id: p for p in natural[:1]})
    return sorted(found.values(), key=lambda p: not p.of_flow)


def _explained(
    recording: Recording,
    found: Search,
    findings: tuple[Finding, ...],
    proofs: Sequence[Proof],
    model: Writable,
    shown: Told,
    hidden: Sequence[Reconstruction],
    evidence: tuple[Evidence, ...],
    begin: float,
) -> Explained:
    fitted = found.best.fitted
    system = fitted.rows.system
    locations = tuple(location_of(found.best, f) for f in findings)
    failing = (*impossible(recording, system.ruleset), *stuck(recording, system.ruleset))
    findings = (*findings, *failing)
    shares = shares_of(found.accepted)
    return Explained(
        findings=findings,
        locations=(
            *locations,
            *(failed_at(f) for f in failing),
            *(_location(fitted, h, shares[h.spot.id]) for h in hidden),
        ),
        unnamed=bool(hidden),
        hidden=_driver(system, hidden) if hidden else None,
        missing=system.builder.missing,
        confounded=confounded(fitted),
        untested=_untested(system, findings),
        fits=shown.fits,
        plants=shown.plants,
        repairs=model.repairs,
        left_out=model.left_out,
        heldout=heldout_spans(system.data.time, ~system.data.open),
        curves=_curves(system, shown, model.used, findings) if shown.fits else None,
        series=shown.series,
        evidence=evidence,
        notes=(*([shown.note] if shown.note else []), *_notes(recording, proofs, fitted)),
        split=system.data.split,
        digest=system.data.digest,
        noise=_noise_told(fitted),
        tried=found.tried,
        begin=begin,
    )


def _driver(system: System, found: Sequence[Reconstruction]) -> HiddenDriver:
    hidden, *others = found
    spot = hidden.spot
    lacking = [
        m for m in system.builder.missing if (m.module, m.place) == (spot.module, spot.place)
    ]
    lacking = lacking or [m for m in system.builder.missing if m.module == spot.module]
    text = (
        f"what drives {_what(spot)} is not recorded; "
        f"its course: {described(hidden.time, hidden.course)}"
    )
    text += "".join(
        f"; {_what(other.spot)} changes too, and its course correlates with this one by "
        f"{fixed(likeness(hidden, other), 2)}"
        for other in others
    )
    return HiddenDriver(
        module=spot.module,
        place=spot.place,
        text=text,
        time=hidden.time,
        course=hidden.course / spot.factor,
        unit=spot.unit,
        candidates=tuple(dict.fromkeys(m.title for m in lacking)),
        sensor=lacking[0].sensor if lacking else "",
    )


def _what(spot: Spot) -> str:
    # A parameter is a place by its id, `parameter:A.C2`.
    what = f"{spot.id.partition(':')[2]} in" if spot.kind == "parameter" else "the error of"
    return f"{what} {spot.module}.{spot.place}"


def _location(fitted: Fitted, hidden: Reconstruction, share: float) -> Location:
    system = fitted.rows.system
    joined = next(c for c in fitted.setting.joined if c.id == hidden.spot.id)
    contribution = np.where(fitted.used, term_of(fitted, joined), np.nan)
    variables = variables_of(system, hidden.spot.module)
    return Location(
        module=hidden.spot.module,
        place=hidden.spot.place,
        title=hidden.spot.title,
        share=share,
        region=region_of(system, contribution, variables),
        periods=(),
        also=_also(fitted, hidden.spot),
    )


def _also(fitted: Fitted, spot: Spot) -> tuple[str, ...]:
    """Places whose errors look the same in all residuals."""
    found = {s.spot.id: s for s in suspects(fitted)}
    own = found.pop(spot.id, None)
    others = (s for s in found.values() if own is not None and alike(own, s))
    return tuple(f"{s.spot.module}.{s.spot.place}" for s in others)


def _untested(system: System, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Ranges beyond which a repaired law was never tried."""
    candidates = {c.id: c for c in system.builder.candidates}
    told: dict[str, None] = {}
    for finding in findings:
        if finding.id not in candidates or finding.sort not in ("physics", "ageing"):
            continue
        for name in candidates[finding.id].drivers.values():
            signal = system.ruleset.signal_by_id.get(name)
            if signal is not None:
                values = system.data.values[name]
                low, high = np.nanquantile(values, [0.0, 1.0])
                low, high = ((v - signal.offset) / signal.factor for v in (low, high))
                told[f"{name} below {low:.4g} or above {high:.4g} {signal.unit}"] = None
    return tuple(told)


def _noise_told(fitted: Fitted) -> str:
    """Where the size of the noise comes from, and how large what is left is against it."""
    source = (
        "rows are settled points of their own; noise by the classes of the sensors"
        if fitted.rows.system.data.of_rows
        else "noise by the scatter of neighbouring samples"
    )
    local = noise_scale(fitted.rows, fitted.residual)
    return (
        f"{source}; neighbouring residuals scatter {local:.2g} times that, "
        f"all residuals of the repaired model {fitted.scale:.2g} times"
    )


def _notes(recording: Recording, proofs: Sequence[Proof], fitted: Fitted) -> tuple[str, ...]:
    data = fitted.rows.system.data
    what = "operating points" if data.of_rows else "files, each with a clock of its own,"
    notes = [] if data.timed else [NO_CLOCK.format(what=what)]
    notes += _moved(fitted)
    notes += [*recording.notes, *(f"{name} is not in the recording" for name in recording.missing)]
    if proofs and proofs[0].faulty:
        notes.append(
            f"{proofs[0].faulty} settled points lie in periods of faults; errors are those of the "
            "others (in held-out blocks periods are found by the finished model)"
        )
    if proofs and not proofs[0].fit.heldout.points:
        notes.append("no held-out point is free of faults: nothing is proved")
    return tuple(notes)


def _moved(fitted: Fitted) -> Iterator[str]:
    """A remark for each module whose calibration had to be let go, and by how much."""
    known = fitted.rows.system.builder.parameters
    u = np.sqrt(np.diag(known.covariance)) if len(known.ids) else np.zeros(0)
    for module in sorted(fitted.setting.released):
        own = [
            (abs(fitted.setting.values[n] - known.values[i]) / u[i], n)
            for i, n in enumerate(known.ids)
            if n.partition(".")[0] == module and u[i] > 0 and n in fitted.setting.values
        ]
        far, name = max(own, default=(0.0, ""))
        if module in fitted.setting.trusted:
            yield (
                f"the calibration of {module} contradicts its data sheet; with what was found the "
                f"data sheet holds, and {name} moved by {far:.0f} of its calibrated uncertainties"
            )
        elif far > FAR_MOVED:
            yield f"{name} moved by {far:.0f} of its stated uncertainties; was {module} changed?"


def _curves(system: System, told: Told, judged: np.ndarray, findings: Sequence[Finding]) -> Curves:
    """Courses of the first reading that errors are told of; `judged` flags points that count."""
    data, name = system.data, told.fits[0].signal
    signal, predicted = system.ruleset.signal_by_id[name], told.curves[name]

    def shown(values: Array) -> Array:
        result: Array = (values - signal.offset) / signal.factor
        return result

    module = findings[0].module if findings else signal.id.partition(".")[0]
    drivers = {}
    for name, values in variables_of(system, module).items():
        spec = system.ruleset.signal_by_id.get(name)
        if spec is not None and name != signal.id:
            drivers[f"{name} [{spec.unit}]"] = (values - spec.offset) / spec.factor
    return Curves(
        data.time,
        shown(data.values[signal.id]),
        shown(predicted.shipped),
        shown(predicted.recalibrated),
        shown(predicted.repaired),
        data.part == HELDOUT,
        drivers,
        judged & np.isfinite(predicted.recalibrated) & np.isfinite(predicted.repaired),
    )


def _to_be_read(recording: Recording) -> str:
    """Which columns to look at: those without a number; of these first the ones that are there."""
    absent = set(recording.missing)
    empty = [n for n, v in recording.values.items() if not np.isfinite(v).any()]
    empty = sorted(empty, key=lambda name: name in absent)
    names, more = empty[:SHOWN], len(empty) - SHOWN
    names += [counted(more, "other")] if more > 0 else []
    return f"Look at {listed(names)} in the recording: there is not one number." if empty else ""


def _cannot(
    recording: Recording, ruleset: Ruleset, data: Data | None, why: str, begin: float
) -> Mismatch:
    """The answer where nothing can be compared."""
    notes = [*recording.notes, *(f"{name} is not in the recording" for name in recording.missing)]
    return Mismatch(
        plant=ruleset.plant,
        title=ruleset.title,
        recording="",
        verdict="cannot judge",
        headline=f"Cannot judge: {why}.",
        locations=(),
        findings=(),
        fit=None,
        fits=(),
        confounded=(),
        hidden=None,
        untested=(),
        next=next_step("cannot judge", (), None, ()),
        split=data.split if data else "",
        digest=data.digest if data else "",
        noise="",
        tried=0,
        notes=tuple(notes),
        joined=(),
        parameters=(),
        covariance=np.zeros((0, 0)),
        curves=None,
        seconds=time.perf_counter() - begin,
        series=Series(data.time, ~data.open) if data else None,
        evidence=evidence_of(recording, data),
    )
