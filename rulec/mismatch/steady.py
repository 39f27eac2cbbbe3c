"""A recording of a plant that settles, explained by errors in variables at settled points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.points import is_bad
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import counted, fixed, listed

from rulec.effects.candidate import Candidate, DisturbanceLocation
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits
from rulec.mismatch.answer.findings import location_at, of_recordings, shares_of, updates_of
from rulec.mismatch.answer.verdict import TO_RECORD
from rulec.mismatch.answer.written_plant import (
    Explained,
    NotComparable,
    Plants,
    Reading,
    Refits,
    file_of,
)
from rulec.mismatch.evidence.configuration import HIDDEN, Configuration
from rulec.mismatch.evidence.failing_sensors import impossible, stuck
from rulec.mismatch.evidence.model import HELDOUT
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.model import SteadyModel, evidence_of, model_of
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.repaired_model import (
    Predictor,
    no_lasting_errors,
    predictor_of,
    predictors_for,
    repair_of,
    with_sensors_as_they_are,
)
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.screen import alike, noise_scale
from rulec.mismatch.evidence.steady.system import System, system_of
from rulec.mismatch.inference.heldout_errors import Predicted, Proof, fit_of, rms
from rulec.mismatch.result import Evidence, Finding, Fit, LatentInput, Location
from rulec.mismatch.search.intermittent_fault import in_periods
from rulec.mismatch.search.latent_input import Reconstruction, described, likeness, reconstruct
from rulec.mismatch.search.later_refits import (
    ByRecording,
    as_written,
    by_recording,
    clear_states,
    possible_sets,
)
from rulec.mismatch.search.operating_states import Found, search
from rulec.simulation.predict import predict

SHOWN = 4
"""Most readings listed that have no number."""


def explain(
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
    heldout: Sequence[tuple[float, float]],
    tell: Callable[[str], None],
) -> Explanation | NotComparable:
    """Find the settled points, and search for an explanation of them."""
    tell("finding settled points")
    data = prepare(recording, ruleset, heldout)
    count = 0 if data is None else int(data.open.sum())
    if data is None or count < limits.FEWEST_POINTS:
        return NotComparable(
            why=f"{count} settled points; at least {limits.FEWEST_POINTS} are needed",
            next=TO_RECORD,
            samples=data,
            evidence=evidence_of(recording, data),
        )
    rows = rows_of(system_of(ruleset, builder, data), Configuration())
    if rows.groups < limits.FEWEST_POINTS:
        return NotComparable(
            why="no two estimates of one flow can be compared with the readings of this recording",
            next=_to_be_read(recording) or TO_RECORD,
            samples=data,
            evidence=evidence_of(recording, data, rows),
        )
    found = search(rows, tell)
    by = by_recording(recording, rows.system, heldout, found.posterior, tell)
    return _explained(recording, found, by)


def _explained(recording: Recording, found: Found, by: ByRecording | None) -> Explanation:
    fitted, accepted, posterior = found.fitted, found.accepted, found.posterior
    system = fitted.rows.system
    # Places with an unrecorded driver, in the order in which they were found.
    latent = tuple(reconstruct(fitted, location) for location in fitted.setting.locations)
    curves = [a.curve for a in accepted if latent and a.candidate.id == latent[0].location.id]
    switching = next((curve.says for curve in curves if curve is not None), "")
    model, shares = model_of(fitted), shares_of(accepted)
    return Explanation(
        recording=recording,
        model=model,
        accepted=accepted,
        failing=(*impossible(recording, system.ruleset), *stuck(recording, system.ruleset)),
        locations=tuple(_location(model, o.location, shares[o.location.id]) for o in latent),
        latent_input=_latent_input(system, latent, switching) if latent else None,
        noise=_noise_words(fitted),
        untimed="operating points"
        if system.data.of_rows
        else "files, each with a clock of its own,",
        fitted=fitted,
        latent=latent,
        standing=possible_sets(posterior),
        recordings=of_recordings(recording, fitted.rows, by) if by else (),
        changed=updates_of(recording.sources, by) if by else (),
        nothing=posterior.unseen,
        believed=posterior.models[posterior.selected].setting.values,
        posterior=posterior,
        curves=tuple(term for curve in found.curves for term in curve.terms),
    )


def _location(model: SteadyModel, location: DisturbanceLocation, share: float) -> Location:
    """A place with an unrecorded driver, whose course shows the times."""
    term = model.term(next(c for c in model.joined if c.id == location.id))
    also = tuple(f"{s.module}.{s.place}" for s in alike(model.fitted, location))
    where = (location.module, location.place, location.title)
    return replace(location_at(model, where, share, term, also, {}), periods=())


def _noise_words(fitted: Fitted) -> str:
    source = (
        "each row is a settled point; noise from the classes of the sensors"
        if fitted.rows.system.data.of_rows
        else "noise from the scatter of neighbouring samples"
    )
    local = noise_scale(fitted.rows, fitted.residual)
    return (
        f"{source}; neighbouring residuals scatter {local:.2g} times as much, all residuals of the "
        f"repaired model {fitted.scale:.2g} times"
    )


def _to_be_read(recording: Recording) -> str:
    """Which columns to look at: those without a number, columns that exist first."""
    absent = set(recording.missing)
    empty = [n for n, v in recording.values.items() if not np.isfinite(v).any()]
    empty = sorted(empty, key=lambda name: name in absent)
    names, more = empty[:SHOWN], len(empty) - SHOWN
    names += [counted(more, "other")] if more > 0 else []
    return f"Look at {listed(names)} in the recording: no cell holds a number." if empty else ""


@dataclass(frozen=True)
class Models:
    """Models to compare with the shipped one, fitted to all points that are not held out.

    `faulty`, shape (n,), flags points in periods of faults; the finished model finds these in
    held-out blocks.
    """

    recalibrated: Configuration
    repaired: Configuration
    fitted: Fitted
    faulty: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Explanation(Explained[Fitted]):
    """An explanation by errors in variables; `fitted` is the model with everything accepted.

    `latent` are courses of unrecorded drivers.
    """

    fitted: Fitted
    latent: tuple[Reconstruction, ...]

    @cached_property
    def allowed(self) -> dict[str, float]:
        return self.posterior.tolerance.allowed

    @property
    def _system(self) -> System:
        return self.fitted.rows.system

    @cached_property
    def _models(self) -> Models:
        """The repaired model, and those to compare it with; faults that come and go are in all of
        them while these are fitted, as no model has them, and in none that predicts."""
        repaired = with_sensors_as_they_are(self.fitted)
        setting, data = repaired.setting, self._system.data
        passing = [c for c in setting.courses if setting.candidate_of(c).sort != HIDDEN]
        faults = {setting.candidate_of(course).id for course in passing}
        plain = setting.leaving(*(c.id for c in setting.joined if c.id not in faults))
        recalibrated = with_sensors_as_they_are(repaired, plain).setting
        faulty = np.zeros(len(data), dtype=bool)
        for course in passing:
            if course.grows:
                faulty |= course.segment >= 0
                continue
            faulty |= (course.segment >= 0) & data.open
            # In held-out blocks the finished model finds the periods.
            fault = setting.candidate_of(course)
            every = np.ones(len(data), dtype=bool)
            bare = fit(repaired.rows, setting.leaving(fault.id), every, steps=0)
            trial = in_periods(bare, fault)
            if trial is not None and trial.course is not None:
                faulty |= (trial.course.segment >= 0) & ~data.open
        return Models(recalibrated.leaving(*faults), setting.leaving(*faults), repaired, faulty)

    def proofs(self, findings: Sequence[Finding]) -> list[Proof]:
        """One proof per reading whose errors are reported, flows first."""
        found: dict[str, tuple[bool, Proof]] = {}
        for location in self._locations(findings):
            natural = predictors_for(self._system, *location)
            natural = [p for p in natural if p.by_inputs] or natural[: limits.PREDICTORS_TRIED]
            if natural and natural[0].of_flow:
                natural = natural[:1]
            tried = [(p.of_flow, prove(p, self._models)) for p in natural]
            if tried:
                best = max(tried, key=lambda own: round(gain_shown(own[1]), 3))
                found[best[1].fit.signal] = best
        proofs = [proof for _, proof in sorted(found.values(), key=lambda own: not own[0])]
        # If a fault covers all held-out samples of a reading, they prove nothing.
        return [proof for proof in proofs if proof.fit.heldout.points] or proofs

    def _locations(
        self, findings: Sequence[Finding]
    ) -> list[tuple[tuple[str, ...], frozenset[str], str]]:
        """Observers, drivers and unit of the place of each finding, else those of the plant."""
        system = self._system
        candidates = {c.id: c for c in system.builder.candidates}
        locations = {(s.module, s.place): s for s in system.builder.locations}
        found: list[tuple[tuple[str, ...], frozenset[str], str]] = []
        for finding in findings:
            if finding.id in candidates:
                candidate = candidates[finding.id]
                location = locations.get((finding.module, finding.place))
                drivers = frozenset(candidate.drivers.values())
                found.append((candidate.observers, drivers, location.unit if location else ""))
            elif finding.sort == "free":
                location = locations[finding.module, finding.place]
                found.append((location.observers, frozenset(), location.unit))
        found += [(h.location.observers, frozenset(), h.location.unit) for h in self.latent]
        return found or [(tuple(o.id for o in system.observers), frozenset(), "")]

    def refitted(
        self, taken: Sequence[Candidate], left_out: Sequence[tuple[Candidate, str]]
    ) -> Refits[Fitted]:
        """Refits to points outside periods of faults, with laws as accurate as stated."""
        settled, clear = self._models.fitted, self._clear
        setting, chosen = settled.setting, {c.id for c in taken}
        bare = setting.leaving(*(c.id for c in setting.joined))
        setting = setting.leaving(*(c.id for c in setting.joined if c.id not in chosen))
        for curve in (c for c in taken if c.sort == "curve"):
            setting = setting.joining(curve, {}, {u.id: u.factor for u in curve.unknowns})
        rows = clear_states(self._system, clear)
        plain = repaired = as_written(rows, [bare, Configuration()])
        if setting.joined:
            values = {**setting.values, **plain.setting.values}
            repaired = as_written(rows, [setting, replace(setting, values=values)])
        left = tuple((c.id, why) for c, why in left_out if c in settled.setting.joined)
        models = (plain, repaired)
        none = no_lasting_errors(self._system)
        first, last = (fit(settled.rows, m.setting, settled.used & clear, 0, none) for m in models)
        repairs = repair_of(first, plain.covariance), repair_of(last, repaired.covariance)
        curves = tuple(curve for curve in self.curves if curve.id in chosen)
        repairs = repairs[0], replace(repairs[1], curves=curves)
        return Refits(plain=first, repaired=last, repairs=repairs, left_out=left, judged=clear)

    @property
    def _clear(self) -> np.ndarray:
        """Points outside periods of faults, shape (n,); all points if these are too few."""
        open_, clear = self._system.data.open, ~self._models.faulty
        enough = (open_ & clear).sum() >= limits.KEPT * open_.sum()
        return clear if enough else np.ones_like(clear)

    def readings(
        self, plants: Plants | None, refits: Refits[Fitted], proofs: Sequence[Proof]
    ) -> list[Reading]:
        """Means of simulated readings at settled points."""
        system = self._system
        explained = {p.fit.signal: p.fit for p in proofs}
        found: dict[str, Predicted] = {}
        if plants is not None:
            tables = (plants.shipped, plants.recalibrated, plants.last)
            for name in _signals(plants, system, list(explained)):
                courses = (_at_points(self.recording, system, name, t) for t in tables)
                found[name] = Predicted(*courses)
        simulated = plants is not None and bool(found)
        if not simulated:
            settings = (Configuration(), refits.plain.setting, refits.repaired.setting)
            for name, fitted in explained.items():
                predictor = predictor_of(system, fitted.relation or "", name)
                found[name] = Predicted(*(predictor.predicted(s) for s in settings))
        scale = noise_scale(refits.repaired.rows, refits.repaired.residual)
        result = []
        for name, predicted in found.items():
            signal, measured = system.ruleset.signal_by_id[name], system.data.values[name]
            own = explained.get(name)
            if plants is not None and simulated:
                noise = _noise(plants.rulesets[2], system, name) * scale
            else:
                noise = explained[name].heldout.noise * signal.factor
            # Where no estimate may use the reading, its module stands.
            users = [i for i, o in enumerate(system.observers) if name in o.signals]
            usable = refits.judged & np.any(system.valid[users], axis=0)
            parts = (system.data.open & usable, (system.data.part == HELDOUT) & usable)
            whole = (own.estimation.repaired, own.heldout.repaired) if own else (np.nan, np.nan)
            fit_ = fit_of(signal, [p - measured for p in predicted], (noise, noise), parts, whole)
            fit_ = replace(fit_, relation=own.relation if own else None, simulated=simulated)
            result.append(Reading(fit=fit_, measured=measured, predicted=predicted))
        return result

    def rows_used(self, proofs: Sequence[Proof]) -> tuple[Evidence, ...]:
        """What settled points were used for, and why other rows were not."""
        judged = np.any([proof.judged for proof in proofs], axis=0) if proofs else None
        data = self._system.data
        return evidence_of(self.recording, data, self.fitted.rows, judged, self._models.faulty)

    def notes(
        self, refits: Refits[Fitted], proofs: Sequence[Proof], fits: Sequence[Fit], why: str
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Which errors are reported; which points lie in faults."""
        before, behind = [], []
        if why or (fits and not fits[0].simulated):
            why = why or "simulation takes it as given"
            before.append(f"errors are those of relations solved for the reading: {why}")
        faulty = int(self._models.faulty.sum())
        if proofs and faulty:
            behind.append(
                f"{faulty} settled points lie in periods of faults; errors are those of the others "
                "(in held-out blocks periods are found by the finished model)"
            )
        if proofs and not proofs[0].fit.heldout.points:
            behind.append("no held-out point is free of faults: nothing is proved")
        return tuple(before), tuple(behind)


def _latent_input(system: System, found: Sequence[Reconstruction], switching: str) -> LatentInput:
    first, *others = found
    location = first.location
    near = [m for m in system.builder.missing if m.module == location.module]
    lacking = [m for m in near if m.place == location.place] or near
    text = (
        f"what drives {_what(location)} is not recorded; "
        f"its course: {described(first.time, first.course)}"
    )
    if switching:
        lacking, text = [], f"{_what(location)} {switching}"
    text += "".join(
        f"; {_what(other.location)} changes too, and its course correlates with this one by "
        f"{fixed(likeness(first, other), 2)}"
        for other in others
    )
    return LatentInput(
        module=location.module,
        place=location.place,
        text=text,
        time=first.time,
        course=first.course / location.factor,
        unit=location.unit,
        candidates=tuple(dict.fromkeys(m.title for m in lacking)),
        sensor=lacking[0].sensor if lacking else "",
        switches=bool(switching),
    )


def _what(location: DisturbanceLocation) -> str:
    # The id of a parameter as a place is like `parameter:A.C2`.
    what = f"{location.id.partition(':')[2]} in" if location.kind == "parameter" else "the error of"
    return f"{what} {location.module}.{location.place}"


def gain_shown(proof: Proof) -> float:
    """Ratio of a reading's errors before and after the repair, on points not held out."""
    before, after = proof.fit.estimation.recalibrated, proof.fit.estimation.repaired
    return before / after if after > 0.0 else 0.0


def prove(predictor: Predictor, models: Models) -> Proof:
    """Open the held-out blocks, once."""
    rows, data = models.fitted.rows, models.fitted.rows.system.data
    settings = (Configuration(), models.recalibrated, models.repaired)
    predicted = Predicted(*(predictor.predicted(setting) for setting in settings))
    measured = data.values[predictor.signal.id]
    judged = np.isfinite(measured) & predictor.points & ~models.faulty
    judged &= np.all([np.isfinite(p) for p in predicted], axis=0)
    noise = predictor.noise(models.repaired) * noise_scale(rows, models.fitted.residual)
    parts = (judged & data.open, judged & (data.part == HELDOUT))
    sizes = (rms(noise[parts[0]]), rms(noise[parts[1]]))
    found = fit_of(predictor.signal, [p - measured for p in predicted], sizes, parts)
    return Proof(replace(found, relation=predictor.residual.id), predicted, judged)


def _signals(plants: Plants, system: System, asked: Sequence[str]) -> list[str]:
    """Readings with reported errors: those asked for, else the measured ones of their modules."""
    values = system.data.values
    there = [n for n in plants.signals if n in values and np.isfinite(values[n]).any()]
    modules = {name.partition(".")[0] for name in asked}
    near = [n for n in there if n.partition(".")[0] in modules]
    return (
        [n for n in asked if n in there]
        or near[: limits.MOST_PREDICTED]
        or there[: limits.MOST_PREDICTED]
    )


def _at_points(
    recording: Recording, system: System, name: str, table: Mapping[str, Array]
) -> Array:
    """A predicted reading at settled points, shape (n,), SI: measured plus the mean error."""
    readings = recording.values[name]
    bad = is_bad(system.ruleset.signal_by_id[name], readings)
    off = np.where(bad, np.nan, table[name] - readings)
    sums = np.concatenate([[0.0], np.cumsum(np.nan_to_num(off))])
    counts = np.concatenate([[0], np.cumsum(np.isfinite(off))])
    first, last = system.data.stretches.first, system.data.stretches.last
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (sums[last] - sums[first]) / (counts[last] - counts[first])
    return np.asarray(system.data.values[name] + mean)


def _noise(ruleset: Ruleset, system: System, name: str) -> float:
    """Standard uncertainty of measured minus simulated due to the noise of all readings, SI."""
    data = system.data
    table = dict(data.values)
    file = file_of("settled points", data.time, table)
    plain = predict(ruleset, [file])
    variance = data.noise[name] ** 2
    for given in plain.given:
        if given in data.noise:
            moved = {**table, given: table[given] + np.nan_to_num(data.noise[given])}
            course = predict(ruleset, [replace(file, values=moved)]).values[name]
            variance = variance + np.nan_to_num(course - plain.values[name]) ** 2
    return rms(np.sqrt(variance[np.isfinite(variance)]))
