"""What may be written of an explanation, fitted alone, and how good it is: simulated as written.

A plant file holds laws and values, nothing else. Faults, errors of sensors and courses in time are
left out before the fit, not behind it: values that were fitted beside them are those of another
model. Samples in faults are set aside, and sensors read as they are: whoever uses the plant reads
the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rulec.effects.adopt import why_not
from rulec.effects.candidate import Candidate, Unwritable
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits
from rulec.mismatch.answer.explained import Explained, F, Refits
from rulec.mismatch.answer.public import Plants, plants_of
from rulec.mismatch.evidence.steady.configuration import HIDDEN
from rulec.mismatch.inference.prove import Proof
from rulec.mismatch.inference.series import course_of
from rulec.mismatch.result import Fit, Series
from rulec.simulation.equations import SimulationRefused

UNDRIVEN = "what drives it is not recorded"
UNSURE = "it may as well be something else"


def writable(found: Explained[F]) -> Refits[F]:
    """Refit what may be written, and the plain model.

    Of explanations that show the same, the likeliest one that may be written stands for all. Beside
    one that is sure, what may as well be something else is left out: the plant would hold it.
    """
    taken: list[Candidate] = []
    left_out = []
    sure = {a.candidate.id for a in found.accepted if a.class_probability >= limits.CERTAIN}
    for candidate in found.model.joined:
        if sure and candidate.id not in sure:
            left_out.append((candidate, UNSURE))
            continue
        why = _why_not(candidate, found.model.builder)
        instead = _instead(found, candidate) if why else candidate
        if instead is not None:
            taken.append(instead)
        if why:
            same = f"; {instead.title} in {instead.module} shows the same" if instead else ""
            left_out.append((candidate, f"{why}{same}, and is adopted" if same else why))
    return found.refitted(taken, left_out)


def _instead(found: Explained[F], candidate: Candidate) -> Candidate | None:
    """The likeliest one that may be written of those that show as one that may not."""
    own = next((a for a in found.accepted if a.candidate.id == candidate.id), None)
    alike = [c for c, _ in own.others if own.same.get(c.id)] if own else []
    return next((c for c in alike if not _why_not(c, found.model.builder)), None)


def _why_not(candidate: Candidate, builder: ModelBuilder) -> str:
    """Why no plant file can hold an explanation; empty where one can."""
    return UNDRIVEN if candidate.sort == HIDDEN else why_not(candidate, builder.network)


@dataclass(frozen=True, kw_only=True)
class Told:
    """Errors of the three plants, their courses, and what was simulated.

    `plants` is None where the plant cannot be simulated, which `why` tells.
    """

    fits: tuple[Fit, ...]
    series: Series
    plants: Plants | None
    why: str


def told(found: Explained[F], refits: Refits[F], proofs: Sequence[Proof]) -> Told:
    """Simulate the plants over the recording, and compare."""
    model, why = found.model, ""
    ruleset, builder, recording = model.ruleset, model.builder, found.recording
    try:
        plants: Plants | None = plants_of(ruleset, builder, recording, *refits.repairs)
    except (SimulationRefused, Unwritable) as error:
        plants, why = None, str(error)
    readings = found.readings(plants, refits, proofs)
    signals = ruleset.signal_by_id
    courses = (course_of(signals[r.fit.signal], r.measured, r.predicted) for r in readings)
    samples = model.samples
    return Told(
        fits=tuple(r.fit for r in readings),
        series=Series(samples.time, ~samples.open, tuple(courses)),
        plants=plants,
        why=why,
    )
