"""From a recording to a diagnosis: the passes of the runtime in order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.hidden_faults import Blind, blind_of
from rulec_runtime.diagnosis.sensors.conditions import SensorFinding
from rulec_runtime.diagnosis.sensors.sensor_health import Health, examine
from rulec_runtime.diagnosis.steady.evaluated_points import (
    EvaluatedPoints,
    evaluate_stretches,
    judgeable,
)
from rulec_runtime.diagnosis.steady.events import events_of
from rulec_runtime.diagnosis.steady.evidence import Latest, latest_of
from rulec_runtime.diagnosis.steady.findings import Finding, Found, Period, Visited, visited_of
from rulec_runtime.diagnosis.steady.growing_faults import found_of
from rulec_runtime.diagnosis.steady.liquid import is_ordinary
from rulec_runtime.diagnosis.steady.off_sheet import against_sheet
from rulec_runtime.diagnosis.steady.regimes import RegimeFinding, regimes_of
from rulec_runtime.diagnosis.steady.verdict import shown_without
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Timeline, timeline_of


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """The diagnosis of a recording."""

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
    latest: Latest | None = None
    regimes: tuple[RegimeFinding, ...] = ()
    blind: tuple[Blind, ...] = ()
    visited: Visited | None = None

    @property
    def is_whole(self) -> bool:
        """Whether something was judged and no readings hid a fault."""
        return self.judged > 0 and not self.blind


def diagnose(recording: Recording, ruleset: Ruleset, mode: str = "default") -> Diagnosis:
    """Judge a recording.

    Parameters
    ----------
    mode : ``default`` compares whole residual vectors, ``paper`` is Eqs. 17-19 of the seed paper.
    """
    health = examine(recording, ruleset)
    sound = health.recording
    notes: tuple[str, ...] = ()
    if ruleset.dynamics is None:
        judged, found = _of_settled(sound, ruleset, mode)
    else:
        # The integrator takes a second to load, and only plants that store need it.
        from rulec_runtime.diagnosis.stores.diagnose import judge_stores

        result = judge_stores(sound, ruleset)
        judged, found, notes = int(result.covered.sum()), result.found, result.notes
        if mode != "default":
            odd = f"mode {mode} knows no balances of what is stored: judged as by default"
            notes = (odd, *notes)
    return assembled(health, ruleset, mode, judged=judged, found=found, notes=notes)


def assembled(
    health: Health,
    ruleset: Ruleset,
    mode: str,
    *,
    judged: int,
    found: Found,
    notes: tuple[str, ...] = (),
) -> Diagnosis:
    """The diagnosis by sensors and physics, in order of time."""
    recording = health.recording
    weather = [f for f in found.findings if is_ordinary(ruleset.liquid, f.fault.id, f.degree)]
    found = replace(found, findings=[f for f in found.findings if f not in weather])
    ordinary = dict.fromkeys(f"{f.text}, as a change of the weather does" for f in weather)
    missing = (f"{name} is not in the recording" for name in recording.missing)
    blind = blind_of(recording, ruleset)
    return in_order(
        ruleset,
        mode,
        samples=len(recording),
        judged=judged,
        found=found,
        notes=(*recording.notes, *missing, *notes, *ordinary),
        sensors=health.findings,
        calendar=recording.calendar,
        blind=tuple(one for b in blind if (one := b.but(found.without)).faults),
    )


def in_order(
    ruleset: Ruleset,
    mode: str,
    *,
    samples: int,
    judged: int,
    found: Found,
    notes: tuple[str, ...],
    sensors: tuple[SensorFinding, ...] = (),
    calendar: Calendar | None,
    blind: tuple[Blind, ...],
) -> Diagnosis:
    """A diagnosis in order of time, with the NE 107 letter of the whole."""
    letters = {f.condition.status for f in sensors} | {f.fault.status for f in found.findings}
    letters |= {r.regime.status for r in found.regimes} | ({"S"} if found.unknown else set())
    return Diagnosis(
        ruleset=ruleset,
        mode=mode,
        samples=samples,
        judged=judged,
        status=worst(letters if judged and not blind else letters | {"C"}),
        findings=tuple(sorted(found.findings, key=lambda f: f.since)),
        unknown=tuple(sorted(found.unknown, key=lambda p: p.since)),
        not_judged=tuple(sorted(found.not_judged, key=lambda p: p.since)),
        notes=notes,
        sensors=sensors,
        calendar=calendar,
        latest=found.latest,
        regimes=tuple(sorted(found.regimes, key=lambda r: r.since)),
        blind=blind,
        visited=found.visited,
    )


def _of_settled(recording: Recording, ruleset: Ruleset, mode: str) -> tuple[int, Found]:
    stretches, noise = judgeable(recording, ruleset, mode)
    if not len(stretches):
        since, until = float(recording.time[0]), float(recording.time[-1])
        return 0, Found([], [], [Period(since, until, restless(len(recording)))])
    evaluated = evaluate_stretches(recording, ruleset, stretches, noise, mode)
    judged, found = judged_parts(ruleset, timeline_of(recording.time, stretches), evaluated)
    found.findings.extend(events_of(recording, ruleset, stretches, noise, evaluated, mode))
    return judged, found


def judged_parts(
    ruleset: Ruleset, timeline: Timeline, evaluated: Sequence[EvaluatedPoints]
) -> tuple[int, Found]:
    """Number of judged samples, and what all parts of a plant show in settled stretches."""
    each = [against_sheet(timeline, p, found_of(timeline, ruleset, p)) for p in evaluated]
    judged = np.any([part.isolation.judged for part in evaluated], axis=0)
    found = Found(
        [f for own in each for f in own.findings],
        [p for own in each for p in own.unknown],
        [p for own in each for p in own.not_judged],
        latest_of(ruleset, timeline, evaluated),
        regimes_of(ruleset, timeline, evaluated[0].points),
        visited_of(timeline, evaluated[0].points, judged),
        frozenset(shown_without(evaluated)),
    )
    return int(timeline.samples[judged].sum()), found


def restless(samples: int) -> str:
    """Why nothing could be judged at all."""
    needed = limits.SHORTEST_STRETCH
    if samples < needed:
        plural = "s" * (samples != 1)
        return f"the recording has {samples} sample{plural}; a settled stretch needs {needed}"
    return f"no settled stretch was found: no {needed} samples in a row without a jump"


def worst(letters: set[str]) -> str:
    """NE 107 letter of the whole: F over C over S over M."""
    return next((letter for letter in "FCSM" if letter in letters), "ok")
