"""From a recording to a diagnosis: the passes of the runtime in order."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.conditions import SensorFinding
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.findings import Finding, Period, findings_of
from rulec_runtime.diagnosis.steady.seen import see_stretches
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import settle
from rulec_runtime.recordings.wall_clock import Calendar


@dataclass(frozen=True, kw_only=True)
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
    sensors: tuple[SensorFinding, ...] = ()
    calendar: Calendar | None = None


def diagnose(recording: Recording, ruleset: Ruleset, mode: str = "default") -> Diagnosis:
    """Judge a recording.

    Parameters
    ----------
    mode : ``default`` compares whole residual vectors, ``paper`` is Eqs. 17-19 of the seed paper.
    """
    health = examine(recording, ruleset)
    found = _of_sound(health.recording, ruleset, mode)
    letters = {f.condition.status for f in health.findings} | {found.status}
    return replace(
        found,
        status=next((letter for letter in "FCSM" if letter in letters), "ok"),
        sensors=health.findings,
        calendar=recording.calendar,
    )


def _of_sound(recording: Recording, ruleset: Ruleset, mode: str) -> Diagnosis:
    """The diagnosis of a recording without the readings that are none."""
    if ruleset.dynamics is not None:
        return _of_stores(recording, ruleset, mode)
    stretches, noise = settle(recording, ruleset)
    notes = list(recording.notes)
    notes += [f"{name} is not in the recording" for name in recording.missing]
    if not len(stretches):
        period = Period(
            float(recording.time[0]), float(recording.time[-1]), _restless(len(recording))
        )
        return Diagnosis(
            ruleset=ruleset,
            mode=mode,
            samples=len(recording),
            judged=0,
            status="C",
            findings=(),
            unknown=(),
            not_judged=(period,),
            notes=tuple(notes),
        )
    findings: list[Finding] = []
    unknown: list[Period] = []
    not_judged: list[Period] = []
    judged = np.zeros(len(stretches), dtype=bool)
    for seen in see_stretches(recording, ruleset, stretches, noise, mode):
        found = findings_of(recording.time, ruleset, stretches, seen)
        findings += found.findings
        unknown += found.unknown
        not_judged += found.not_judged
        judged |= seen.isolation.judged
    samples = int(stretches.lengths[judged].sum())
    return Diagnosis(
        ruleset=ruleset,
        mode=mode,
        samples=len(recording),
        judged=samples,
        status=_status(findings, unknown, samples),
        findings=tuple(sorted(findings, key=lambda f: f.since)),
        unknown=tuple(sorted(unknown, key=lambda p: p.since)),
        not_judged=tuple(sorted(not_judged, key=lambda p: p.since)),
        notes=tuple(notes),
    )


def _of_stores(recording: Recording, ruleset: Ruleset, mode: str) -> Diagnosis:
    """The diagnosis of a plant that stores: there is one mode only."""
    # The integrator takes a second to load, and plants that store nothing do without it.
    from rulec_runtime.diagnosis.stores.diagnose import judge_stores

    said = judge_stores(recording, ruleset)
    notes = [*recording.notes, *(f"{name} is not in the recording" for name in recording.missing)]
    if mode != "default":
        notes.append(f"mode {mode} knows no balances of what is stored: judged as by default")
    samples = int(said.covered.sum())
    return Diagnosis(
        ruleset=ruleset,
        mode=mode,
        samples=len(recording),
        judged=samples,
        status=_status(list(said.findings), list(said.unknown), samples),
        findings=tuple(sorted(said.findings, key=lambda f: f.since)),
        unknown=said.unknown,
        not_judged=said.not_judged,
        notes=(*notes, *said.notes),
    )


def _restless(samples: int) -> str:
    """Why nothing could be judged at all."""
    needed = limits.SHORTEST_STRETCH
    if samples < needed:
        plural = "s" * (samples != 1)
        return f"the recording has {samples} sample{plural}; a settled stretch needs {needed}"
    return f"no settled stretch was found: no {needed} samples in a row without a jump"


def _status(findings: list[Finding], unknown: list[Period], judged: int) -> str:
    """NE 107 letter of the whole: F over C over S over M."""
    letters = {f.fault.status for f in findings} | ({"S"} if unknown else set())
    if not judged:
        letters.add("C")
    return next((letter for letter in "FCSM" if letter in letters), "ok")
