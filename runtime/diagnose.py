"""From a recording to a diagnosis: the passes of the runtime in order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from runtime.baseline import Baselines, against, learn, nothing_learned
from runtime.causes import Seen
from runtime.findings import Finding, Period, findings_of
from runtime.isolate import Isolation, isolate
from runtime.observe import Observed, observe, points_of_samples, points_of_stretches
from runtime.paper_mode import judge_by_paper
from runtime.plan import Array
from runtime.recording import Recording
from runtime.ruleset import Ruleset
from runtime.runs import COVERAGE
from runtime.stationary import SHORTEST, Stretches, find_stretches, noise_at_work
from runtime.verdict import Verdict, verdict_at

BLOCK = 16_384
"""Samples judged at a time, so that memory stays flat."""


@dataclass(frozen=True)
class Diagnosis:
    """What the recording says about the plant."""

    ruleset: Ruleset
    mode: str
    samples: int
    judged: int
    status: str
    findings: tuple[Finding, ...]
    unknown: tuple[Period, ...]
    not_judged: tuple[Period, ...]
    notes: tuple[str, ...]


def diagnose(recording: Recording, ruleset: Ruleset, mode: str = "default") -> Diagnosis:
    """Judge a recording.

    Parameters
    ----------
    mode : ``default`` compares whole residual vectors, ``paper`` is Eqs. 17-19 of the seed paper.
    """
    noise = noise_at_work(recording, ruleset)
    stretches = find_stretches(recording, ruleset, noise)
    notes = list(recording.notes)
    notes += [f"{name} is not in the recording" for name in recording.missing]
    if not len(stretches):
        period = Period(
            float(recording.time[0]), float(recording.time[-1]), _restless(len(recording))
        )
        return Diagnosis(ruleset, mode, len(recording), 0, "C", (), (), (period,), tuple(notes))
    seen = _see(recording, ruleset, stretches, noise, mode)
    verdicts = [
        verdict_at(ruleset, seen.observed, seen.isolation, i) for i in range(len(stretches))
    ]
    findings, unknown, not_judged = findings_of(recording.time, ruleset, stretches, seen, verdicts)
    judged = int(stretches.lengths[seen.isolation.judged].sum())
    status = _status(findings, unknown, judged)
    return Diagnosis(
        ruleset,
        mode,
        len(recording),
        judged,
        status,
        tuple(findings),
        tuple(unknown),
        tuple(not_judged),
        tuple(notes),
    )


def _restless(samples: int) -> str:
    """Why nothing could be judged at all."""
    if samples < SHORTEST:
        plural = "s" * (samples != 1)
        return f"the recording has {samples} sample{plural}; a settled stretch needs {SHORTEST}"
    return f"no settled stretch was found: no {SHORTEST} samples in a row without a jump"


def _see(
    recording: Recording,
    ruleset: Ruleset,
    stretches: Stretches,
    noise: Mapping[str, float],
    mode: str,
) -> Seen:
    """Observe the stretches, learn the baseline, isolate; the paper knows no baseline."""
    observed = observe(ruleset, points_of_stretches(recording, ruleset, stretches, noise))
    if mode == "paper":
        nothing = Baselines((nothing_learned(observed),), np.zeros(len(observed), dtype=int))
        paper = _by_paper(ruleset, observed, isolate(ruleset, observed))
        return Seen(observed, observed, nothing, paper, combined=False)
    baselines = learn(ruleset, observed)
    compared = against(ruleset, observed, baselines)
    return Seen(observed, compared, baselines, isolate(ruleset, compared))


def _by_paper(ruleset: Ruleset, observed: Observed, isolation: Isolation) -> Isolation:
    """Put the paper's verdicts in the place of ours; its winner counts as certain."""
    paper = judge_by_paper(ruleset, observed)
    best = paper.degree.max(axis=0, initial=0.0)
    deviating = paper.deviating & (best > 0) & isolation.judged
    chosen = np.zeros_like(paper.degree)
    chosen[paper.winner(), np.arange(len(observed))] = deviating
    half = (paper.upper - paper.lower) / (2 * COVERAGE)
    return replace(
        isolation,
        deviating=deviating,
        degree=paper.degree,
        u=np.maximum(half, 1e-12),
        distance=np.where(chosen > 0, 0.0, np.inf),
        probability=chosen,
        pair=np.full((len(observed), 2), -1),
    )


def _status(findings: list[Finding], unknown: list[Period], judged: int) -> str:
    """NE 107 letter of the whole: F over C over S over M."""
    letters = {f.fault.status for f in findings} | ({"S"} if unknown else set())
    if not judged:
        letters.add("C")
    return next((letter for letter in "FCSM" if letter in letters), "ok")


@dataclass(frozen=True)
class Trace:
    """Per sample: verdict, and per fault degree and bounds, shape (faults, n)."""

    time: Array
    verdict: tuple[str, ...]
    degree: Array
    lower: Array
    upper: Array


def trace(recording: Recording, ruleset: Ruleset, mode: str = "default") -> Trace:
    """Judge every sample of the settled stretches on its own; the others are ``moving``."""
    noise = noise_at_work(recording, ruleset)
    stretches = find_stretches(recording, ruleset, noise)
    if not len(stretches):
        blank = np.zeros((len(ruleset.faults), len(recording)))
        return Trace(recording.time, ("moving",) * len(recording), blank, blank, blank)
    settled = [np.arange(a, b) for a, b in zip(stretches.first, stretches.last, strict=True)]
    index = np.concatenate(settled)
    points = points_of_samples(recording, ruleset, noise)
    words = ["moving"] * len(recording)
    degree = np.zeros((len(ruleset.faults), len(recording)))
    half = np.zeros_like(degree)
    baselines = _see(recording, ruleset, stretches, noise, mode).baselines
    state = np.repeat(baselines.at, stretches.lengths)
    for low in range(0, len(index), BLOCK):
        chosen = index[low : low + BLOCK]
        observed = observe(ruleset, points.at(chosen))
        observed = against(ruleset, observed, baselines, state[low : low + BLOCK])
        isolation = isolate(ruleset, observed, len(index))
        if mode == "paper":
            isolation = _by_paper(ruleset, observed, isolation)
        for i, sample in enumerate(chosen):
            words[sample] = _word(ruleset, verdict_at(ruleset, observed, isolation, i))
        fits = isolation.probability > 0
        degree[:, chosen] = np.where(fits, isolation.degree, 0.0)
        half[:, chosen] = np.where(fits, COVERAGE * isolation.u, 0.0)
    return Trace(
        recording.time, tuple(words), degree, np.maximum(degree - half, 0.0), degree + half
    )


def _word(ruleset: Ruleset, verdict: Verdict) -> str:
    """A verdict as it stands in the trace: a fault's id, or what else is to be said."""
    if verdict.kind == "fault":
        return " + ".join(ruleset.faults[i].id for i in verdict.faults)
    return {"blind": "cannot judge", "outside": "unknown"}.get(verdict.kind, verdict.kind)
