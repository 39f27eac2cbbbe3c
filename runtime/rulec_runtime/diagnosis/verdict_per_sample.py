"""A verdict for every sample, where a diagnosis judges whole stretches."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.steady.evaluated_points import (
    EvaluatedPoints,
    evaluate_samples,
    evaluate_stretches,
    judgeable,
)
from rulec_runtime.diagnosis.steady.verdict import verdict_at
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import flags_of


@dataclass(frozen=True)
class Trace:
    """Per sample: verdict, and per fault degree and bounds, shape (faults, n).

    `faults` are the ids of those faults: all listed ones, and others if they are named.
    """

    time: Array
    verdict: tuple[str, ...]
    degree: Array
    lower: Array
    upper: Array
    faults: tuple[str, ...]

    def of(self, fault: str) -> tuple[Array, Array, Array]:
        """Degree and bounds of one fault, shape (n,) each; 0 if no sample names it."""
        if fault not in self.faults:
            none = np.zeros(len(self.time))
            return none, none, none
        row = self.faults.index(fault)
        return self.degree[row], self.lower[row], self.upper[row]


QUIET = ("ok", "cannot judge")
"""Words that give way to those of other blocks of estimates."""


def trace(recording: Recording, ruleset: Ruleset, mode: str = "default") -> Trace:
    """Judge every sample of the settled stretches on its own; the others are ``moving``.

    Samples of a plant that stores have the verdict of their windows.
    """
    recording = examine(recording, ruleset).recording
    if ruleset.dynamics is not None:
        return _of_stores(recording, ruleset)
    stretches, noise = judgeable(recording, ruleset, mode)
    words = ["moving"] * len(recording)
    of_stretches: list[EvaluatedPoints] = []
    if len(stretches):
        of_stretches = evaluate_stretches(recording, ruleset, stretches, noise, mode, keep=True)
    names = tuple(dict.fromkeys([*(f.id for f in ruleset.faults), *_unlisted(of_stretches)]))
    rows = {name: row for row, name in enumerate(names)}
    degree, half = np.zeros((2, len(rows), len(recording)))
    inside = flags_of(len(recording), stretches.first, stretches.last)
    samples = np.flatnonzero(inside)
    of_samples = evaluate_samples(recording, ruleset, noise, stretches, of_stretches, samples)
    for here, evaluated in of_samples if of_stretches else ():
        sound = np.all([p.isolation.judged & ~p.isolation.deviating for p in evaluated], axis=0)
        for i, sample in enumerate(here.tolist()):
            words[sample] = "ok" if sound[i] else _word(evaluated, i)
        for one in evaluated:
            own = [i for i, f in enumerate(one.part.ruleset.faults) if f.id in rows]
            there = np.array([rows[one.part.ruleset.faults[i].id] for i in own], dtype=int)
            fits, at = one.isolation.probability[own] > 0, np.ix_(there, here)
            degree[at] += np.where(fits, one.isolation.degree[own], 0.0)
            half[at] += np.where(fits, limits.COVERAGE * one.isolation.u[own], 0.0)
    return _traced(recording, words, degree, half, names)


def _traced(
    recording: Recording, words: list[str], degree: Array, half: Array, names: tuple[str, ...]
) -> Trace:
    lower = np.maximum(degree - half, 0.0)
    return Trace(recording.time, tuple(words), degree, lower, degree + half, names)


def _unlisted(of_stretches: Sequence[EvaluatedPoints]) -> Iterator[str]:
    for evaluated in of_stretches:
        faults = evaluated.part.ruleset.faults
        for point in np.flatnonzero(evaluated.isolation.deviating).tolist():
            named = (faults[i] for i in verdict_at(evaluated, point).faults)
            yield from (fault.id for fault in named if fault.unlisted)


def _word(evaluated: Sequence[EvaluatedPoints], point: int) -> str:
    """Verdicts of all parts as written to the trace: ids of faults, or another word."""
    words = dict.fromkeys(_of_part(part, point) for part in evaluated)
    loud = [word for word in words if word not in QUIET]
    return " + ".join(loud) or ("ok" if "ok" in words else "cannot judge")


def _of_part(evaluated: EvaluatedPoints, point: int) -> str:
    verdict = verdict_at(evaluated, point)
    if verdict.kind == "fault":
        return " + ".join(evaluated.part.ruleset.faults[i].id for i in verdict.faults)
    return {"blind": "cannot judge", "outside": "unknown"}.get(verdict.kind, verdict.kind)


def _of_stores(recording: Recording, ruleset: Ruleset) -> Trace:
    """Each sample has the verdict of the window with the nearest middle."""
    # The integrator takes a second to load, and only plants that store need it.
    from rulec_runtime.diagnosis.stores.diagnose import judge_stores

    result, time = judge_stores(recording, ruleset), recording.time
    words = ["cannot judge"] * len(time)
    degree, half = np.zeros((2, len(ruleset.faults), len(time)))
    row = {f.id: i for i, f in enumerate(ruleset.faults)}
    judged = sorted(result.judged, key=lambda one: one.window.middle)
    middles = np.array([one.window.middle for one in judged])
    nearest = np.searchsorted(0.5 * (middles[1:] + middles[:-1]), time)
    for sample in np.flatnonzero(result.covered).tolist():
        one = judged[int(nearest[sample])]
        if one.plain is not None:
            words[sample] = "ok"
        for name in one.fitting:
            degree[row[name], sample] = one.tests[name].degree
            half[row[name], sample] = limits.COVERAGE * one.tests[name].u
    reported = [(p.since, p.until, "unknown") for p in result.found.unknown]
    reported += [(f.since, f.until, f.fault.id) for f in result.found.findings]
    for since, until, word in reported:
        for i in np.flatnonzero((time >= since) & (time <= until)).tolist():
            words[i] = words[i] if words[i] == "cannot judge" else word
    return _traced(recording, words, degree, half, tuple(row))
