"""Evaluation of the points of a recording, one block of estimates at a time."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.baseline import (
    SHIFTED,
    Baselines,
    Learner,
    against,
    nothing_learned,
)
from rulec_runtime.diagnosis.steady.batch_means import Halves, drift_of, halves_of, with_drift
from rulec_runtime.diagnosis.steady.batches import in_batches
from rulec_runtime.diagnosis.steady.independent_parts import Part, parts_of
from rulec_runtime.diagnosis.steady.isolate import POINTS_ALONG as EXPLAINED_ALONG
from rulec_runtime.diagnosis.steady.isolate import Isolation, isolate
from rulec_runtime.diagnosis.steady.lasting_fault import throughout
from rulec_runtime.diagnosis.steady.observe import (
    POINTS_ALONG,
    Observed,
    extrapolated,
    observe_part,
    trusted,
)
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper
from rulec_runtime.diagnosis.steady.points import Points, points_of_samples, points_of_stretches
from rulec_runtime.diagnosis.steady.redundancy import at_once
from rulec_runtime.diagnosis.steady.removed_reading import of_samples, with_stand_ins
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.slow_motion import lag_errors, settle_or_slow
from rulec_runtime.recordings.stationary import Stretches, settle

BATCH = 16_384
"""Samples judged at a time, so that memory use stays constant."""

PAPER = "paper"
"""The mode that follows the seed paper to the letter."""


@dataclass(frozen=True, kw_only=True)
class EvaluatedPoints:
    """Full evaluation of `points` for one part of the plant.

    Observers, residuals and faults are those of the ruleset of the part. `observed` is relative to
    the baselines, `plain` is not. If points are not `combined` (paper mode), a run takes the mean
    of their results.
    """

    part: Part
    points: Points
    plain: Observed
    observed: Observed
    baselines: Baselines
    isolation: Isolation
    combined: bool


def judgeable(
    recording: Recording, ruleset: Ruleset, mode: str
) -> tuple[Stretches, dict[str, float]]:
    """Stretches that a mode judges, and the noise of readings; the paper takes settled ones."""
    return settle(recording, ruleset) if mode == PAPER else settle_or_slow(recording, ruleset)


def evaluate_stretches(
    recording: Recording,
    ruleset: Ruleset,
    stretches: Stretches,
    noise: Mapping[str, float],
    mode: str,
    *,
    keep: bool = False,
) -> list[EvaluatedPoints]:
    """Observe the stretches, learn the baseline of each block, isolate; `keep` the baselines if
    samples are to be compared with them."""
    points = points_of_stretches(recording, ruleset, stretches, noise)
    halves = halves_of(recording, ruleset, stretches)
    return evaluate_points(ruleset, points, halves, mode, keep=keep)


def evaluate_points(
    ruleset: Ruleset, points: Points, halves: Halves, mode: str, *, keep: bool = False
) -> list[EvaluatedPoints]:
    """The same for stretches whose samples are gone."""
    parts = parts_of(ruleset)
    for part in parts:
        points = with_stand_ins(part.ruleset, points)
    return [evaluate_part(ruleset, part, points, mode, halves, keep=keep) for part in parts]


def evaluate_part(
    whole: Ruleset,
    part: Part,
    points: Points,
    mode: str,
    halves: Halves | None = None,
    *,
    keep: bool = False,
    observed: Observed | None = None,
) -> EvaluatedPoints:
    """Learn the baseline of one part of a plant, and isolate; `observed` are existing estimates, of
    the part only."""
    ruleset, count, learner = part.ruleset, len(points), Learner(part.ruleset, keep=keep)
    alike = ruleset is whole or observed is not None
    own = points if alike else points.of(ruleset.observed)

    def judged(chosen: slice) -> tuple[Observed, Observed, Isolation]:
        plain = observed
        if plain is None:
            plain = observe_part(whole, part, points.at(chosen))
        found = plain
        if mode == PAPER:
            isolation = _by_paper(ruleset, plain, isolate(ruleset, plain, count))
        else:
            plain = trusted(ruleset, plain)
            if halves is not None:
                apart = halves.part(part.observers, chosen)
                plain = with_drift(plain, drift_of(ruleset, plain, apart))
            baselines = learner.take(plain, chosen.start)
            found = against(ruleset, plain, baselines, np.arange(len(plain)))
            isolation = isolate(ruleset, found, count)
        return plain.cache(), found.cache(), isolation

    shifted = {name: POINTS_ALONG[name] for name in SHIFTED}
    along = POINTS_ALONG, shifted, EXPLAINED_ALONG
    size = at_once(ruleset) if observed is None else max(count, 1)
    plain, found, isolation = in_batches(count, along, judged, size)
    outside = extrapolated(whole, points) if observed is None else observed.extrapolated
    plain = replace(plain, points=own, extrapolated=outside)
    compared = replace(plain, **{name: getattr(found, name) for name in shifted})
    baselines = learner.baselines()
    if mode == PAPER or throughout(ruleset, plain, isolation):
        # A fault that is there throughout is the baseline of all points.
        compared, baselines = plain, nothing_learned(plain)
    return EvaluatedPoints(
        part=part,
        points=points,
        plain=plain,
        observed=compared,
        baselines=baselines,
        isolation=isolation,
        combined=mode != PAPER,
    )


def evaluate_samples(
    recording: Recording,
    ruleset: Ruleset,
    noise: Mapping[str, float],
    stretches: Stretches,
    of_stretches: list[EvaluatedPoints],
    chosen: np.ndarray,
) -> Iterator[tuple[np.ndarray, list[EvaluatedPoints]]]:
    """Evaluate every chosen sample on its own, in batches, against the baselines of its stretch."""
    points = points_of_samples(recording, ruleset, noise)
    stretch = np.searchsorted(stretches.first, np.arange(len(recording)), side="right") - 1
    stretch = np.maximum(stretch, 0)
    lag = lag_errors(recording, ruleset, stretches, noise)
    points = replace(points, lag={name: errors[stretch] for name, errors in lag.items()})
    points = of_samples(points, of_stretches[0].points, stretch)
    for low in range(0, len(chosen), BATCH):
        here = chosen[low : low + BATCH]
        some, at, looks = points.at(here), stretch[here], len(chosen)
        yield here, [_evaluate_samples(ruleset, some, s, at, looks) for s in of_stretches]


def _evaluate_samples(
    whole: Ruleset, points: Points, evaluated: EvaluatedPoints, stretch: np.ndarray, looks: int
) -> EvaluatedPoints:
    ruleset, plain = evaluated.part.ruleset, observe_part(whole, evaluated.part, points)
    if not evaluated.combined:
        isolation = _by_paper(ruleset, plain, isolate(ruleset, plain, looks))
        return replace(evaluated, points=points, plain=plain, observed=plain, isolation=isolation)
    plain = with_drift(trusted(ruleset, plain), evaluated.plain.drift[stretch])
    compared = against(ruleset, plain, evaluated.baselines, stretch)
    isolation = isolate(ruleset, compared, looks)
    return replace(evaluated, points=points, plain=plain, observed=compared, isolation=isolation)


def residuals_at(ruleset: Ruleset, evaluated: list[EvaluatedPoints]) -> tuple[Array, Array]:
    """Residuals and their uncertainties, shape (residuals, n), each from its part."""
    values, u = np.full((2, len(ruleset.residuals), len(evaluated[0].plain)), np.nan)
    for one in evaluated:
        rows = one.part.residuals
        values[rows], u[rows] = one.observed.residuals, one.observed.residual_u
    return values, u


def usable_at(ruleset: Ruleset, evaluated: list[EvaluatedPoints]) -> np.ndarray:
    """Usable estimates, flags of shape (observers, n)."""
    valid = np.zeros((len(ruleset.observers), len(evaluated[0].plain)), dtype=bool)
    for one in evaluated:
        valid[one.part.observers] |= one.observed.valid
    return valid


def _by_paper(ruleset: Ruleset, observed: Observed, isolation: Isolation) -> Isolation:
    """Replace our verdicts by the paper's; its winner counts as certain."""
    paper = judge_by_paper(ruleset, observed)
    best = paper.degree.max(axis=0, initial=0.0)
    deviating = paper.deviating & (best > 0) & isolation.judged
    chosen = np.zeros_like(paper.degree)
    chosen[paper.winner(), np.arange(len(observed))] = deviating
    half = (paper.upper - paper.lower) / (2 * limits.COVERAGE)
    return replace(
        isolation,
        deviating=deviating,
        degree=paper.degree,
        u=np.maximum(half, limits.LEAST_U),
        distance=np.where(chosen > 0, 0.0, np.inf),
        probability=chosen,
        pair=np.full((len(observed), 2), -1),
    )
