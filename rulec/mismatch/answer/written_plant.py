"""The writable part of an explanation, fitted alone, and its errors as any user would find them.

A plant file holds only laws and values. Faults, sensor errors and courses in time are left out
before the fit, not after it: values fitted beside them belong to another model. Errors are those of
plants that are written, compiled and simulated as by `rulec simulate`: of the shipped, the
recalibrated and the repaired plant alike.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.header import Header
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.recording_file import RecordingFile
from rulec_runtime.report.text import number

from rulec.effects.adopt import why_not
from rulec.effects.candidate import Candidate, CurveTerm, Unwritable
from rulec.effects.model_builder import ModelBuilder
from rulec.effects.write_plant import trial
from rulec.mismatch import limits
from rulec.mismatch.answer.wording import suffix
from rulec.mismatch.evidence.configuration import HIDDEN
from rulec.mismatch.evidence.model import Model, Samples, inside_of
from rulec.mismatch.inference.heldout_errors import Predicted, Proof, course_of, rms
from rulec.mismatch.result import (
    CandidateSet,
    Check,
    Evidence,
    Finding,
    Fit,
    LatentInput,
    Location,
    OfRecording,
    Repair,
    Series,
    Update,
)
from rulec.mismatch.search.curve_found import Accepted
from rulec.mismatch.search.posterior import Posterior
from rulec.simulation.equations import SimulationRefused
from rulec.simulation.predict import predict

F = TypeVar("F")


@dataclass(frozen=True, kw_only=True)
class NotComparable:
    """Nothing can be compared: why, what to do, and what was read nevertheless."""

    why: str
    next: str
    samples: Samples | None
    evidence: tuple[Evidence, ...]


@dataclass(frozen=True)
class Plants:
    """Readings by the shipped, the recalibrated and the repaired plant, per row of the recording.

    Each is a table by signal, shape (rows,), SI. `repaired` is None if it cannot be written or
    simulated, for the reason `refused`.
    """

    shipped: Mapping[str, Array]
    recalibrated: Mapping[str, Array]
    repaired: Mapping[str, Array] | None
    rulesets: tuple[Ruleset, Ruleset, Ruleset]
    refused: str = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that all of them predict."""
        return tuple(n for n in self.shipped if n in self.recalibrated and n in self.last)

    @property
    def last(self) -> Mapping[str, Array]:
        """Readings by the repaired plant, else by the recalibrated one, shape (rows,), SI."""
        return self.recalibrated if self.repaired is None else self.repaired


@dataclass(frozen=True, kw_only=True)
class Refits(Generic[F]):
    """The recalibrated and the repaired model as they are written, and what was left out.

    `repairs` are the values to write of each. `left_out` has ids with reasons. `judged`, shape
    (n,), flags samples whose errors count.
    """

    plain: F
    repaired: F
    repairs: tuple[Repair, Repair]
    left_out: tuple[tuple[str, str], ...]
    judged: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Reading:
    """A reading with its errors; measured and predicted at the samples, shape (n,), SI."""

    fit: Fit
    measured: Array
    predicted: Predicted


@dataclass(frozen=True, kw_only=True)
class Explained(ABC, Generic[F]):
    """A recording as far as the search explains it.

    `locations` are without a named cause, `failing` are failing sensors. `noise` describes the size
    of the noise, `untimed` what lacks a common time, if so. `standing` are the sets of explanations
    that are still possible, most probable first. Of several recordings, `recordings` has each, and
    `changed` the change by each further one. `nothing` is the probability by `posterior`, over all
    sets, that nothing is missing; `believed` are the values of parameters with the explanation
    found, SI; `curves` are the nameless terms of the most probable set that a module type can hold.
    """

    recording: Recording
    model: Model
    accepted: tuple[Accepted, ...]
    failing: tuple[Finding, ...]
    locations: tuple[Location, ...]
    latent_input: LatentInput | None
    posterior: Posterior
    noise: str
    untimed: str
    standing: tuple[CandidateSet, ...] = ()
    recordings: tuple[OfRecording, ...] = ()
    changed: tuple[Update, ...] = ()
    nothing: float = 1.0
    believed: Mapping[str, float] = field(default_factory=dict)
    curves: tuple[CurveTerm, ...] = ()

    @property
    @abstractmethod
    def allowed(self) -> Mapping[str, float]:
        """Error of each output that sensors within their class and laws within their accuracy
        explain in 95 % of recordings, SI."""

    @abstractmethod
    def proofs(self, findings: Sequence[Finding]) -> list[Proof]:
        """Open the held-out blocks, once; one proof per reading, the most significant first."""

    @abstractmethod
    def refitted(
        self, taken: Sequence[Candidate], left_out: Sequence[tuple[Candidate, str]]
    ) -> Refits[F]:
        """Fit what may be written, and the plain model, without corrections of sensors."""

    @abstractmethod
    def readings(
        self, plants: Plants | None, refits: Refits[F], proofs: Sequence[Proof]
    ) -> list[Reading]:
        """Errors by simulation, else by the relations of the analysis."""

    @abstractmethod
    def rows_used(self, proofs: Sequence[Proof]) -> tuple[Evidence, ...]:
        """What each row of the recording was used for."""

    @abstractmethod
    def notes(
        self, refits: Refits[F], proofs: Sequence[Proof], fits: Sequence[Fit], why: str
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Notes before and after those on the recording; `why` no plant was simulated."""


UNSURE = "something else may explain it as well"


@dataclass(frozen=True, kw_only=True)
class PlantErrors:
    """Errors of the three plants, their courses, and the simulation.

    `plants` is None if the plant cannot be simulated, for the reason `why`.
    """

    fits: tuple[Fit, ...]
    series: Series
    plants: Plants | None
    why: str


def written(found: Explained[F], proofs: Sequence[Proof]) -> tuple[Refits[F], PlantErrors]:
    """What may be written, refitted, and the errors of the plants.

    If something is missing, nameless terms become curves, but not beside a fault, whose shape they
    may have. They stay if the plant is fitted better with them than without.
    """
    certain = [a.candidate for a in found.accepted if a.class_probability >= limits.CERTAIN]
    sure = {c.id for c in certain}
    refits = _refitted(found, sure, [])
    errors = plant_errors(found, refits, proofs)
    broken = found.failing or any(c.sort in ("fault", "sensor") for c in certain)
    if found.curves and not broken and (found.model.joined or found.locations):
        curves = [found.model.builder.curve_term(curve) for curve in found.curves]
        drawn = _refitted(found, sure, curves)
        drawn_errors = plant_errors(found, drawn, proofs)
        # Fitted samples show a smaller error of the first reading, and no larger one of any other.
        before = {fit.signal: max(fit.estimation.repaired, 1e-300) for fit in errors.fits}
        now = [(f.estimation.repaired, before.get(f.signal, np.inf)) for f in drawn_errors.fits]
        falls = [own / earlier for own, earlier in now]
        if falls and falls[0] < 1.0 and max(falls) <= 1.0 + limits.SAME_ERROR:
            return drawn, drawn_errors
    return refits, errors


def _refitted(found: Explained[F], sure: set[str], curves: Sequence[Candidate]) -> Refits[F]:
    """Refits with what may be written, and `curves` in place of what has no name.

    If one explanation is certain, uncertain ones are left out, as the plant would keep them.
    """
    builder, taken, left_out = found.model.builder, list[Candidate](), []
    for candidate in found.model.joined:
        if curves and candidate.sort == "free":
            continue
        if (sure or curves) and candidate.id not in sure:
            left_out.append((candidate, UNSURE))
            continue
        why = _why_not(candidate, builder)
        if why:
            left_out.append((candidate, why))
        else:
            taken.append(candidate)
    return found.refitted([*taken, *curves], left_out)


def _why_not(candidate: Candidate, builder: ModelBuilder) -> str:
    """Why no plant file can hold an explanation; empty if one can."""
    if candidate.sort == HIDDEN:
        return "what drives it is not recorded"
    return why_not(candidate, builder.network)


def plant_errors(found: Explained[F], refits: Refits[F], proofs: Sequence[Proof]) -> PlantErrors:
    """Simulate the plants over the recording, and compare."""
    ruleset, samples, why = found.model.ruleset, found.model.samples, ""
    try:
        plants: Plants | None = plants_of(found.model, found.recording, *refits.repairs)
    except (SimulationRefused, Unwritable) as error:
        plants, why = None, str(error)
    readings = found.readings(plants, refits, proofs)
    signals = ruleset.signal_by_id
    courses = (course_of(signals[r.fit.signal], r.measured, r.predicted) for r in readings)
    return PlantErrors(
        fits=tuple(r.fit for r in readings),
        series=Series(samples.time, ~samples.open, tuple(courses)),
        plants=plants,
        why=why,
    )


def plants_of(model: Model, recording: Recording, plain: Repair, repair: Repair) -> Plants:
    """Write, compile and simulate the plants; raises `SimulationRefused` if that is impossible.

    Raises `Unwritable` if not even recalibrated values can be written.
    """
    first = simulated(model.ruleset, recording)
    recalibrated = repaired = trial(model.builder, plain)
    second, refused = simulated(recalibrated, recording), ""
    third: Mapping[str, Array] | None = second
    if repair.joined:
        try:
            repaired = trial(model.builder, repair)
            third = simulated(repaired, recording)
        except (Unwritable, SimulationRefused) as error:
            repaired, third, refused = recalibrated, None, str(error)
    return Plants(first, second, third, (model.ruleset, recalibrated, repaired), refused)


def simulated(ruleset: Ruleset, recording: Recording) -> Mapping[str, Array]:
    """Readings by `rulec simulate`, per signal, shape (rows,), SI; raises `SimulationRefused`."""
    files = []
    for segment in dict.fromkeys(recording.segment.tolist()):
        rows = recording.segment == segment
        values = {name: v[rows] for name, v in recording.values.items()}
        files.append(file_of(f"file {int(segment) + 1}", recording.time[rows], values))
    return predict(ruleset, files).values


def refusal(
    verdict: str,
    fits: Sequence[Fit],
    joined: Sequence[str],
    unwritten: str,
    checks: Sequence[Check] = (),
    instead: bool = True,
    curves: Sequence[CurveTerm] = (),
) -> str:
    """Why the repaired plant should not be written; empty if it may be.

    `instead`: recalibration alone is an alternative, as its values are credible. If it is not, the
    repair must be better than the shipped plant, and not significantly worse than recalibration.

    Held-out blocks decide nothing else. The repair must lower the error of the first reading
    significantly where errors are reported, and must not raise it over all held-out rows, including
    periods of faults, as a fault may be false. It must not raise the error of any other reading
    significantly.
    """
    if verdict == "ambiguous" and set(joined).difference(c.id for c in curves):
        return "the recording cannot decide between several explanations"
    if unwritten:
        return f"it cannot be written: {unwritten}"
    for i, fit in enumerate(fits if joined else ()):
        held, which = fit.heldout, "held-out"
        if not held.points:
            held, which = fit.estimation, "fitted"
        plain = held.recalibrated if instead or i else held.shipped
        worse = held.repaired > plain * (1.0 + limits.SAME_ERROR)
        if (i == 0 and worse) or is_spoiled(fit):
            return _worse(fit, held.repaired, held.recalibrated, f"on {which} samples")
        if i == 0 and fit.gain_interval[0] <= 0.0 and instead:
            low, high = (number(100.0 * share) for share in fit.gain_interval)
            return (
                f"simulated with it, the error of {fit.signal} on held-out samples falls by {low} "
                f"to {high} % (95 %) compared with recalibrated values only, which may be chance"
            )
    for check in checks if joined and instead else ():
        if check.signal == fits[0].signal and check.error > check.plain * (1.0 + limits.SAME_ERROR):
            return _worse(fits[0], check.error, check.plain, "over all held-out rows")
    return ""


def _worse(fit: Fit, own: float, plain: float, where: str) -> str:
    unit = suffix(fit.unit)
    return (
        f"simulated with it, {fit.signal} is off by {number(own)}{unit} {where}, and by "
        f"{number(plain)}{unit} with recalibrated values alone"
    )


def checks_of(
    plants: Plants, recording: Recording, spans: Sequence[tuple[float, float]]
) -> tuple[Check, ...]:
    """The errors that `rulec adopt` must reproduce: see `row_errors`."""
    ruleset = plants.rulesets[0]
    plain = row_errors(ruleset, plants.recalibrated, recording, spans)
    own = row_errors(ruleset, plants.last, recording, spans)
    both = (n for n in own if n in plain and own[n][1])
    return tuple(Check(signal=n, rows=own[n][1], error=own[n][0], plain=plain[n][0]) for n in both)


def row_errors(
    ruleset: Ruleset,
    predicted: Mapping[str, Array],
    recording: Recording,
    spans: Sequence[tuple[float, float]],
) -> dict[str, tuple[float, int]]:
    """Error of each predicted reading, as shown, over the rows of spans, and the number of rows.

    Rows count if they have a reading and a prediction, and the reading is not below its minimum,
    where the equations do not hold. `predicted` has shape (rows,) per signal, SI; `spans` are in s.
    """
    inside = inside_of(recording.time, spans)
    found = {}
    for name, course in predicted.items():
        if name in recording.values:
            signal, measured = ruleset.signal_by_id[name], recording.values[name]
            low = -np.inf if signal.minimum is None else signal.minimum
            off = (course - measured)[inside & (measured >= low)] / signal.factor
            off = off[np.isfinite(off)]
            found[name] = (rms(off), len(off))
    return found


def file_of(name: str, time: Array, values: dict[str, Array]) -> RecordingFile:
    """Readings, SI, at times, s, shape (n,) each, as a recording file with a name."""
    return RecordingFile(
        path=Path(name), header=Header(), time=time, values=values, zones=None, comma=False
    )


def is_spoiled(fit: Fit) -> bool:
    """Does the repair make the error of a reading significantly worse, and exceed its noise?"""
    held = fit.heldout
    rises = held.repaired - held.recalibrated > limits.SPOILED * held.recalibrated
    return fit.gain_interval[1] < 0.0 and rises and held.repaired > held.noise
