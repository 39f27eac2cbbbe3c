"""A recording of a plant that stores, explained by integration (output errors)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.columns import thinned
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import counted, listed
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import Candidate
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits
from rulec.mismatch.answer.findings import location_of_curve
from rulec.mismatch.answer.written_plant import Explained, NotComparable, Plants, Reading, Refits
from rulec.mismatch.evidence.failing_sensors import failing, impossible, stuck
from rulec.mismatch.evidence.model import counted_rows, inside_of, unread
from rulec.mismatch.evidence.stores.errors_of_form import allowed
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged, independent
from rulec.mismatch.evidence.stores.model import StoresModel, model_of
from rulec.mismatch.evidence.stores.simulation_problem import (
    SimulationProblem,
    lacking,
    noise_floor,
    record_of,
    stored_evidence,
    without_odd,
)
from rulec.mismatch.inference.heldout_errors import Predicted, Proof, fit_of, heldout_spans
from rulec.mismatch.result import Changed, Evidence, Finding, Fit, Location, Repair
from rulec.mismatch.search.curve_found import Accepted
from rulec.mismatch.search.simulated import Found, curves_of, likeliest_curve, search


def explain(
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
    heldout: Sequence[tuple[float, float]],
    tell: Callable[[str], None],
) -> Explanation | NotComparable:
    """Search for an explanation of a recording; held-out blocks may reject it."""
    record = record_of(recording, ruleset, builder.given, heldout)
    if record is None:
        why = lacking(recording, ruleset)
        evidence = counted_rows((), [*unread(recording), *[why] * len(recording)])
        return NotComparable(
            why=why, next="Record again with what is missing.", samples=None, evidence=evidence
        )
    problem = SimulationProblem(ruleset, builder, record)
    try:
        found = search(problem, tell)
    except (np.linalg.LinAlgError, RanAway):
        return NotComparable(
            why="the plant as it is stated runs away with these readings",
            next="Look at the units of the columns and at the values of the plant.",
            samples=record,
            evidence=stored_evidence(recording, record),
        )
    best, accepted = found.best, found.accepted
    proofs = prove(found.plain, best)
    dropped: tuple[str, ...] = ()
    if accepted and not _gains(best, proofs):
        # The named explanations fail on data to which they were not fitted.
        dropped = tuple(f"{a.candidate.title} in {a.candidate.module}" for a in accepted)
        best, accepted = found.plain, ()
    model = model_of(best)
    locations: tuple[Location, ...] = ()
    if found.has_unnamed:
        tell("drawing what has no name")
        unnamed = likeliest_curve(found)
        if unnamed is not None and _gains(unnamed.fitted, prove(found.plain, unnamed.fitted)):
            locations = (location_of_curve(model, unnamed.curve, unnamed.share),)
        elif unnamed is not None and not accepted:
            at = unnamed.curve.location
            dropped = (*dropped, f"A curve without a name at {at.module}.{at.place}")
    result = explanation(recording, model, found, accepted, locations, dropped)
    return result if dropped else replace(result, curves=curves_of(found))


def explanation(
    recording: Recording,
    model: StoresModel,
    found: Found,
    accepted: tuple[Accepted, ...] = (),
    locations: tuple[Location, ...] = (),
    dropped: tuple[str, ...] = (),
) -> Explanation:
    """The result of a search; unrecorded drivers are not sought, but reported as places."""
    ruleset, noise = model.ruleset, model.fitted.noise
    correlated = ", ".join(
        f"{n} over {counted(round(own.correlation_time), 'sample')}" for n, own in noise.items()
    )
    return Explanation(
        recording=recording,
        model=model,
        accepted=accepted,
        failing=tuple(
            finding
            for found_in in (failing, stuck, impossible)
            for finding in found_in(recording, ruleset)
        ),
        locations=locations,
        latent_input=None,
        posterior=found.posterior,
        noise="noise from third differences of the readings; errors of the repaired model are "
        f"correlated ({correlated}) and count once per correlation time",
        untimed="files, each with a clock of its own,",
        found=found,
        dropped=dropped,
        believed=model.fitted.values,
        nothing=1.0 if dropped else found.posterior.unseen,
    )


@dataclass(frozen=True, kw_only=True)
class Explanation(Explained[Fitted]):
    """An explanation by simulation errors.

    `dropped` are titles of explanations that held-out blocks rejected.
    """

    model: StoresModel
    found: Found
    dropped: tuple[str, ...]

    @property
    def _problem(self) -> SimulationProblem:
        return self.model.problem

    @cached_property
    def allowed(self) -> dict[str, float]:
        """Errors that sensors and laws explain, with everything else refitted."""
        return allowed(self.model.fitted)

    def proofs(self, findings: Sequence[Finding]) -> list[Proof]:
        """One proof per measured signal, that with the largest error first."""
        found = prove(self.found.plain, self.model.fitted)
        return sorted(found, key=lambda p: -_worse(p))

    def refitted(
        self, taken: Sequence[Candidate], left_out: Sequence[tuple[Candidate, str]]
    ) -> Refits[Fitted]:
        """Refits to the time before the first fault, whose effect remains in the states.

        Slow errors of inputs and floating zeros do not belong to the plant that is simulated later,
        so neither is in the fit.
        """
        problem, plain, best = self._problem, self.found.plain, self.model.fitted
        before = problem.record.time < until_of(problem, best, [c for c, _ in left_out])
        earlier = {n: flags & before for n, flags in problem.counted.items()}
        judged = replace(independent(problem, best.noise), counted=earlier)
        first = repaired = _refitted(problem, (), [plain.values, {}], judged)
        if taken:
            values = dict(best.values)
            values |= {u.id: u.factor for c in taken if c.sort == "curve" for u in c.unknowns}
            own = {u.id: values[u.id] for c in taken for u in c.unknowns}
            starts = [values, {**first.values, **own}]
            repaired = _refitted(problem, tuple(taken), starts, judged)
        curves = tuple(curve for curve in self.curves if curve.id in {c.id for c in taken})
        return Refits(
            plain=first,
            repaired=repaired,
            repairs=(_repair_of(first), replace(_repair_of(repaired), curves=curves)),
            left_out=tuple((c.id, why) for c, why in left_out),
            judged=np.ones(len(problem.time), dtype=bool),
        )

    def readings(
        self, plants: Plants | None, refits: Refits[Fitted], proofs: Sequence[Proof]
    ) -> list[Reading]:
        """Errors over all rows, as a fault may be false; those of the analysis without
        simulation."""
        problem, record, recording = self._problem, self._problem.record, self.recording
        held = inside_of(recording.time, heldout_spans(record.time, ~record.open))
        factor, found = record.thinning, []
        for proof in (p for p in proofs if plants and p.fit.signal in plants.signals):
            assert plants is not None
            name = proof.fit.signal
            signal = problem.ruleset.signal_by_id[name]
            measured = without_odd(signal, recording.values[name])
            tables = [t[name] for t in (plants.shipped, plants.recalibrated, plants.last)]
            noise = noise_floor(measured[np.isfinite(measured)])
            whole = proof.fit.estimation.repaired, proof.fit.heldout.repaired
            errors, parts = [course - measured for course in tables], (~held, held)
            fit = replace(fit_of(signal, errors, (noise, noise), parts, whole), simulated=True)
            thin = (thinned(recording.time, {}, {"": course}, factor)[2][""] for course in tables)
            predicted = Predicted(*thin)
            found.append(Reading(fit=fit, measured=record.measured[name], predicted=predicted))
        return found or [
            Reading(fit=p.fit, measured=record.measured[p.fit.signal], predicted=p.predicted)
            for p in proofs
        ]

    def rows_used(self, proofs: Sequence[Proof]) -> tuple[Evidence, ...]:
        return stored_evidence(self.recording, self._problem.record)

    def notes(
        self, refits: Refits[Fitted], proofs: Sequence[Proof], fits: Sequence[Fit], why: str
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """What held-out blocks rejected, what is hidden and what remains; what was left out."""
        before = [
            f"{listed(self.dropped)} fitted the other blocks but gained nothing on the held-out "
            "ones, so rulec does not name it; here the held-out blocks took part in the search"
        ] * bool(self.dropped)
        behind = [
            f"{count} single readings of {name} are left out: neither neighbour supports them"
            for name, count in self._problem.record.glitches.items()
            if count
        ]
        if not any(fit.simulated for fit in fits):
            behind.append(
                "errors are those of the analysis: rulec simulate cannot predict this plant"
            )
        left = [c for c in self.model.joined if c.id in dict(refits.left_out)]
        until = until_of(self._problem, self.model.fitted, left)
        if np.isfinite(until):
            behind.append(
                f"a fault begins at {until:.4g} s; values to adopt are fitted to what lies "
                "before it, errors are those of all samples"
            )
        return tuple(before), tuple(behind)


def prove(plain: Fitted, best: Fitted) -> list[Proof]:
    """Open the held-out blocks; one proof per measured signal.

    Slow errors of inputs, within the class of their sensors, are removed from all three models
    alike.
    """
    problem, fitter = plain.problem, Fitter(plain.problem, (), {})
    try:
        shipped: Mapping[str, Array] = fitter.errors(fitter.vector({}), plain.judged)[0]
    except RanAway:
        shipped = {n: np.full(len(v), np.nan) for n, v in problem.record.measured.items()}
    errors = [shipped, plain.errors, best.errors]
    return [_proof(problem, name, [e[name] for e in errors]) for name in problem.signals]


def _proof(problem: SimulationProblem, name: str, errors: list[Array]) -> Proof:
    record, measured = problem.record, problem.record.measured[name]
    finite = np.isfinite(measured) & np.all([np.isfinite(e) for e in errors], axis=0)
    noise = noise_floor(measured[finite])
    parts = (finite & record.open, finite & ~record.open)
    fit = fit_of(problem.ruleset.signal_by_id[name], errors, (noise, noise), parts)
    return Proof(fit, Predicted(*(e + measured for e in errors)), finite)


def _worse(proof: Proof) -> float:
    """The error before the repair, in units of noise."""
    errors = proof.fit.estimation
    return errors.recalibrated / max(errors.noise, 1e-300)


def _gains(best: Fitted, proofs: Sequence[Proof]) -> bool:
    """Whether explanations hold on data to which they were not fitted."""
    return _gained(best, proofs) > _least(proofs)


def _gained(best: Fitted, proofs: Sequence[Proof]) -> float:
    """Gain of explanations in log likelihood on blocks that were not used to find them;
    infinite if no reading has a value there, which rejects nothing."""
    # A reading without one must not hide what the others say.
    found = [(best.noise[p.fit.signal].correlation_time, p.fit.heldout) for p in proofs]
    falls = [
        e.points / time * float(np.log(e.recalibrated / max(e.repaired, 1e-300)))
        for time, e in found
        if e.points
    ]
    return sum(falls) if falls else np.inf


def _least(proofs: Sequence[Proof]) -> float:
    """The required gain there, negative if those blocks show no error but others do."""
    heldout, learnt = (
        any(e.recalibrated > limits.BEYOND_NOISE * e.noise for e in part)
        for part in ([p.fit.heldout for p in proofs], [p.fit.estimation for p in proofs])
    )
    return -limits.PROVEN if learnt and not heldout else limits.PROVEN


def until_of(problem: SimulationProblem, best: Fitted, left: Sequence[Candidate]) -> float:
    """When the first effect begins that no model holds, s; infinite if too early."""
    record = problem.record
    onsets = [best.values[c.onset.id] for c in left if c.onset is not None]
    until = float(record.time[0]) + min(onsets, default=np.inf)
    enough = (record.open & (record.time < until)).sum() >= limits.KEPT * record.open.sum()
    return until if enough else np.inf


def _refitted(
    problem: SimulationProblem,
    joined: tuple[Candidate, ...],
    starts: Sequence[Mapping[str, float]],
    judged: Judged,
) -> Fitted:
    """The best fit from several starts."""
    fitter, found = Fitter(problem, joined, starts[0]), list[Fitted]()
    for start in starts:
        with contextlib.suppress(RanAway):
            at = fitter.vector(start)
            found.append(fitter.finish(at, judged, limits.THOROUGH, limits.ROUNDS))
    return min(found, key=lambda f: _squares(f, judged))


def _squares(fitted: Fitted, judged: Judged) -> float:
    """Squared errors in the same noise for all fits, plus the negative log prior."""
    errors = np.concatenate(list(fitted.errors.values()))
    weighted = (errors / judged.weights)[judged.flags]
    return 0.5 * float(weighted @ weighted) + fitted.negative_log_prior


def _repair_of(fitted: Fitted) -> Repair:
    """The values of a refitted model to write, without misfits and ranges."""
    return Repair(
        fitted.ids,
        tuple(Changed(n, float(fitted.values[n]), fitted.u(n)) for n in fitted.free),
        fitted.covariance,
        {n: v for n, v in fitted.values.items() if n not in fitted.free},
        {},
        {},
    )
